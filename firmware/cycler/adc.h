/* The three inputs: sums of 64 conversions, and what they mean. */
#ifndef ADC_H
#define ADC_H

#include "board.h"

/* A reading in units of the last digit of a data line; whatever is concluded, is concluded from these. */
struct reading {
	int16_t millivolts, milliamperes, tenths; /* mV, mA, 0.1 degC */
};

void adc_start(void);

/* Measure once: 64 conversions of each input, 20 ms. The watchdog is fed here and nowhere else. */
struct reading adc_measure(void);

/* Begin a new mean. */
void adc_begin_mean(void);

/* Measure once more for the mean. */
void adc_add(void);

/* The mean of what was measured since it began. */
struct reading adc_mean(void);

#endif
