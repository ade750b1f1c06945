/* When is measured: twice in the last of the five seconds before a line. */
#ifndef WINDOW_H
#define WINDOW_H

#include "adc.h"
#include "board.h"

/* Begin the five seconds at a tick. */
void window_begin(uint32_t ticks);

/* Measure as it is due, and set the next time. */
void window_measure(void);

/* The mean of the last second. */
struct reading window_mean(void);

#endif
