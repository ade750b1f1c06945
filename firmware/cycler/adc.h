/* The three inputs: sums of 64 conversions, and what they mean. */
#ifndef ADC_H
#define ADC_H

#include "board.h"

/* A reading in units of the last digit of a data line; whatever is concluded, is concluded from these. */
struct reading {
	int16_t millivolts, milliamperes, tenths; /* mV, mA, 0.1 degC */
};

void adc_start(void);

/*
 * Look whether the converter answers: one conversion of each input, 0.6 ms. Due 1.5 s after the last look or measurement,
 * at ALARM_LOOK. The watchdog is fed by these two and nowhere else: it resets a device that does not measure.
 */
void adc_look(void);

/* Measure once: 64 conversions of each input, 20 ms. */
struct reading adc_measure(void);

/* Begin a new mean. */
void adc_begin_mean(void);

/* Measure once more for the mean. */
void adc_add(void);

/* The mean of what was measured since it began. */
struct reading adc_mean(void);

#endif
