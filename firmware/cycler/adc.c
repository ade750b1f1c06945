#include "adc.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <avr/wdt.h>
#include <math.h>
#include <string.h>

#include "clock.h"
#include "eeprom.h"
#include "relays.h"

#define CONVERSIONS 64
#define ONE 1
#define FULL_SCALE 65472.0f /* 64 x 1023 */
#define INPUTS 3
#define SHORTED 9999
#define OPEN (-2730)
#define LOOK_TICKS (TICKS_PER_S * 3 / 2) /* half a second before the watchdog resets */

/* 125 kHz, at which all ten bits are good: a conversion takes 104 us. */
#define ENABLED (_BV(ADEN) | _BV(ADIE) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0))

static uint32_t totals[INPUTS];
static uint8_t measurements;

/* The interrupt only ends the sleep. */
EMPTY_INTERRUPT(ADC_vect)

static void set_look(void)
{
	alarm_set(ALARM_LOOK, clock_ticks() + LOOK_TICKS);
}

void adc_start(void)
{
	ADMUX = _BV(REFS0);
	DIDR0 = _BV(ADC0D) | _BV(ADC1D) | _BV(ADC2D);
	ADCSRA = ENABLED;
	set_look();
}

/* A conversion may end between the look and the sleep: interrupts are off until the very instruction that sleeps. */
static uint16_t convert(void)
{
	ADCSRA = ENABLED | _BV(ADSC);
	cli();
	while (ADCSRA & _BV(ADSC)) {
		sei();
		sleep_cpu();
		if (clock_rang)
			relays_guard();
		cli();
	}
	sei();
	return ADC;
}

/* The first conversion after a change of the input is thrown away: the input has to settle. */
static uint16_t sum_of(uint8_t input, uint8_t conversions)
{
	uint16_t sum = 0;
	ADMUX = _BV(REFS0) | input;
	convert();
	while (conversions--)
		sum += convert();
	return sum;
}

static void measure(uint16_t sums[INPUTS], uint8_t conversions)
{
	clock_arm();
	sleep_enable();
	for (uint8_t input = 0; input < INPUTS; input++)
		sums[input] = sum_of(input, conversions);
	sleep_disable();
	wdt_reset();
	set_look();
}

static int16_t tenths(float u)
{
	if (u < 0.008f)
		return SHORTED;
	if (u > 0.992f)
		return OPEN;
	const float inverse = 1 / 298.15f + logf(u / (1 - u)) / 3950;
	return lroundf(10 * (1 / inverse - 273.15f + eeprom_coefficients.a2));
}

/* `whole` is what the sums of full scale would be. */
static struct reading reading_of(const uint32_t sums[INPUTS], float whole)
{
	const struct coefficients *c = &eeprom_coefficients;
	struct reading reading;
	reading.millivolts = lroundf(1000 * (c->a0 + c->b0 * (sums[0] / whole)));
	reading.milliamperes = lroundf(1000 * (c->a1 + c->b1 * (sums[1] / whole)));
	reading.tenths = tenths(sums[2] / whole);
	return reading;
}

void adc_look(void)
{
	uint16_t sums[INPUTS];
	measure(sums, ONE);
}

struct reading adc_measure(void)
{
	uint16_t sums[INPUTS];
	measure(sums, CONVERSIONS);
	const uint32_t once[INPUTS] = {sums[0], sums[1], sums[2]};
	return reading_of(once, FULL_SCALE);
}

void adc_begin_mean(void)
{
	memset(totals, 0, sizeof totals);
	measurements = 0;
}

void adc_add(void)
{
	uint16_t sums[INPUTS];
	measure(sums, CONVERSIONS);
	for (uint8_t input = 0; input < INPUTS; input++)
		totals[input] += sums[input];
	measurements++;
}

struct reading adc_mean(void)
{
	return reading_of(totals, FULL_SCALE * measurements);
}
