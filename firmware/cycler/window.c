#include "window.h"

#include "clock.h"

#define TIMES 2
#define MS(ms) ((ms) * 125UL / 8)

/* Each in the middle of its half of the last second. */
static const __flash uint32_t offsets[TIMES] = {MS(4240), MS(4740)};

static uint32_t began;
static uint8_t place;

static void set_next(void)
{
	if (place < TIMES)
		alarm_set(ALARM_MEASURE, began + offsets[place]);
	else
		alarm_clear(ALARM_MEASURE);
}

void window_begin(uint32_t ticks)
{
	began = ticks;
	place = 0;
	adc_begin_mean();
	set_next();
}

void window_measure(void)
{
	adc_add();
	place++;
	set_next();
}

struct reading window_mean(void)
{
	return adc_mean();
}
