/* What a level says at its start, and what it does with the bytes of the host. */
#ifndef LEVEL_H
#define LEVEL_H

#include "board.h"

/* Send the banner; `flags` is MCUSR as the reset left it. */
void level_banner(uint8_t flags);

/* Write the reason of the last reset into the line; level 2 has it. */
void level_reset_reason(void);

/* Take a byte of the host. */
void level_receive(uint8_t byte);

#endif
