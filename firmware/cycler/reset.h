/* Why the device was reset. */
#ifndef RESET_H
#define RESET_H

#include "board.h"

/* The reason as level 2 names it. */
const __flash char *reset_reason(void);

#endif
