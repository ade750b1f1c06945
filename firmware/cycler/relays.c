#include "relays.h"

#include <avr/io.h>

#include "clock.h"

#define PAUSE_TICKS 1563 /* 100.03 ms, the first tick after 100 ms */

static enum relay chosen;

void relays_start(void)
{
	relays_open();
	CHARGE_DDR |= _BV(CHARGE_PIN);
	DISCHARGE_DDR |= _BV(DISCHARGE_PIN);
}

void relays_open(void)
{
	CHARGE_PORT &= ~_BV(CHARGE_PIN);
	DISCHARGE_PORT &= ~_BV(DISCHARGE_PIN);
	chosen = RELAY_NONE;
	alarm_clear(ALARM_CLOSE);
}

void relays_choose(enum relay relay, uint32_t decided)
{
	relays_open();
	chosen = relay;
	alarm_set(ALARM_CLOSE, decided + PAUSE_TICKS);
}

void relays_close(void)
{
	if (chosen == RELAY_CHARGE)
		CHARGE_PORT |= _BV(CHARGE_PIN);
	else if (chosen == RELAY_DISCHARGE)
		DISCHARGE_PORT |= _BV(DISCHARGE_PIN);
}

void relays_guard(void)
{
	if (alarm_passed(ALARM_BEAT))
		relays_open();
}

char relays_letter(void)
{
	if (CHARGE_PORT & _BV(CHARGE_PIN))
		return 'C';
	return DISCHARGE_PORT & _BV(DISCHARGE_PIN) ? 'D' : '-';
}
