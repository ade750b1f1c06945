#include "clock.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <util/atomic.h>

/* Timer 1 runs free at 16 MHz / 1024; it is never stopped or set, so that time is exact. */
#define FARTHEST 0x8000
#define TICKS_PER_8_S 125000UL
#define MS_PER_8_S 8000UL

volatile uint8_t clock_rang;

static volatile uint16_t overflows;
static uint32_t anchor_ticks, anchor_ms;
static uint32_t dues[ALARMS];
static bool set[ALARMS];

ISR(TIMER1_OVF_vect)
{
	overflows++;
}

ISR(TIMER1_COMPA_vect)
{
	clock_rang = 1;
}

void clock_start(void)
{
	TCCR1A = 0;
	TIMSK1 = _BV(TOIE1) | _BV(OCIE1A);
	TCCR1B = _BV(CS12) | _BV(CS10);
	set_sleep_mode(SLEEP_MODE_IDLE);
}

uint32_t clock_ticks(void)
{
	uint16_t low, high;
	ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
		low = TCNT1;
		high = overflows;
		if ((TIFR1 & _BV(TOV1)) && low < FARTHEST)
			high++;
	}
	return (uint32_t)high << 16 | low;
}

uint32_t clock_of_stamp(uint16_t stamp)
{
	const uint32_t now = clock_ticks();
	return now - (uint16_t)((uint16_t)now - stamp);
}

/* 125 ticks are 8 ms. The anchor follows in whole steps of both, so that nothing is rounded but the result. */
uint32_t clock_milliseconds(uint32_t ticks)
{
	while ((int32_t)(ticks - anchor_ticks) >= (int32_t)TICKS_PER_8_S) {
		anchor_ticks += TICKS_PER_8_S;
		anchor_ms += MS_PER_8_S;
	}
	while ((int32_t)(ticks - anchor_ticks) < 0) {
		anchor_ticks -= TICKS_PER_8_S;
		anchor_ms -= MS_PER_8_S;
	}
	return anchor_ms + ((ticks - anchor_ticks) * 8 + 62) / 125;
}

void alarm_set(enum alarm alarm, uint32_t due)
{
	dues[alarm] = due;
	set[alarm] = true;
}

void alarm_clear(enum alarm alarm)
{
	set[alarm] = false;
}

static bool passed(enum alarm alarm, uint32_t now)
{
	return set[alarm] && (int32_t)(now - dues[alarm]) >= 0;
}

bool alarm_passed(enum alarm alarm)
{
	return passed(alarm, clock_ticks());
}

bool alarm_take(enum alarm *alarm, uint32_t *due)
{
	const uint32_t now = clock_ticks();
	for (uint8_t each = 0; each < ALARMS; each++) {
		if (passed(each, now)) {
			alarm_clear(each);
			*alarm = each;
			*due = dues[each];
			return true;
		}
	}
	return false;
}

bool clock_arm(void)
{
	const uint32_t now = clock_ticks();
	int32_t nearest = FARTHEST;
	for (uint8_t each = 0; each < ALARMS; each++) {
		const int32_t left = dues[each] - now;
		if (set[each] && left < nearest)
			nearest = left;
	}
	clock_rang = nearest <= 0;
	if (clock_rang)
		return false;
	const uint16_t match = (uint16_t)now + (uint16_t)nearest;
	if (OCR1A != match)
		OCR1A = match;
	/* Where the instant passed in between, the match would come 4.2 s late. */
	if ((int32_t)(clock_ticks() - now) >= nearest)
		clock_rang = 1;
	return !clock_rang;
}

void clock_wait(const volatile uint8_t *ready)
{
	while (!*ready && !clock_rang)
		clock_sleep(ready);
}

void clock_sleep(const volatile uint8_t *ready)
{
	cli();
	if (!*ready && !clock_rang) {
		sleep_enable();
		sei();
		sleep_cpu();
		sleep_disable();
	}
	sei();
}
