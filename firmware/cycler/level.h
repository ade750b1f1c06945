/* What a level says at its start, and what it does with the bytes of the host. */
#ifndef LEVEL_H
#define LEVEL_H

#include "board.h"

/* Send the banner. */
void level_banner(void);

/* Take a byte of the host. */
void level_receive(uint8_t byte);

#endif
