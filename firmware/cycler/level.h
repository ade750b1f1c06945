/* What a level says at its start, and what it does with the bytes of the host. */
#ifndef LEVEL_H
#define LEVEL_H

#include "board.h"

/* Send the banner; `flags` is MCUSR as the reset left it. */
void level_banner(uint8_t flags);

/* Take a byte of the host. */
void level_receive(uint8_t byte);

#endif
