/* The two relays: never closed together, open wherever nothing else is decided. */
#ifndef RELAYS_H
#define RELAYS_H

#include "board.h"

enum relay { RELAY_NONE, RELAY_CHARGE, RELAY_DISCHARGE };

void relays_start(void);

/* Open both at once, and forget what should have closed. */
void relays_open(void);

/* Open both; one closes 100 ms after the tick `decided`. */
void relays_choose(enum relay relay, uint32_t decided);

/* Close what was chosen; its pause is over. */
void relays_close(void);

/*
 * Open both if the heartbeat is overdue, for whoever waits for something: the mark follows when the main loop comes to
 * it.
 */
void relays_guard(void);

/* `C`, `D` or `-`: what is closed. */
char relays_letter(void);

#endif
