/* The commands of level 2. */
#ifndef COMMANDS_H
#define COMMANDS_H

#include "board.h"

/* Execute a command that came at a tick, and reply; words stand one after the other, each ended by a 0. */
void command_execute(const char *tag, const char *words, uint8_t count, uint32_t ticks);

#endif
