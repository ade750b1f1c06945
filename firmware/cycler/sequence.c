#include "sequence.h"

#include <string.h>

#include "clock.h"
#include "lines.h"
#include "relays.h"
#include "settings.h"
#include "window.h"

#define LINE_S 5

struct sequence sequence;

static bool discharge_follows;

void sequence_start(void)
{
	settings_reset();
	window_begin(0);
	alarm_set(ALARM_IDLE, TICKS_PER_LINE);
}

bool sequence_runs(void)
{
	return sequence.state == CHARGE || sequence.state == REST || sequence.state == DISCHARGE;
}

static void begin_half(enum state state)
{
	sequence.state = state;
	memset(&sequence.half, 0, sizeof sequence.half);
}

static void charge(uint32_t ticks)
{
	sequence.cycle++;
	begin_half(CHARGE);
	relays_choose(RELAY_CHARGE, ticks);
	line_begin();
	line_flash(FLASH("TEST ITERATION "));
	line_number(sequence.cycle);
	line_count();
	line_send();
}

static void discharge(uint32_t ticks)
{
	begin_half(DISCHARGE);
	relays_choose(RELAY_DISCHARGE, ticks);
}

void sequence_begin(uint32_t ticks)
{
	sequence.cycle = 0;
	window_begin(ticks);
	alarm_set(ALARM_LINE, ticks + TICKS_PER_LINE);
	sequence_beat(ticks);
	charge(ticks);
}

static void finish(enum state state)
{
	relays_open();
	alarm_clear(ALARM_LINE);
	alarm_clear(ALARM_BEAT);
	sequence.state = state;
}

void sequence_stop(void)
{
	finish(STOPPED);
}

void sequence_clear(void)
{
	sequence.state = IDLE;
	sequence.reason = LIMIT_NONE;
}

static void trip(enum limit reason)
{
	finish(TRIPPED);
	sequence.reason = reason;
	line_begin();
	line_flash(FLASH("TEST TRIPPED "));
	limit_name(reason);
	line_count();
	line_send();
}

void sequence_beat(uint32_t ticks)
{
	if (LEVEL == 2)
		alarm_set(ALARM_BEAT, ticks + settings[BEAT] * TICKS_PER_S);
}

static bool half_ended(const struct reading *reading)
{
	if (sequence.state == CHARGE)
		return reading->milliamperes <= settings[IEND] && (LEVEL == 1 || reading->millivolts >= settings[VFULL]);
	if (sequence.state == DISCHARGE)
		return reading->millivolts <= settings[VEND];
	return sequence.half.lines * LINE_S >= (uint32_t)settings[REST_TIME];
}

static enum limit limit_of(const struct reading *reading, bool ended)
{
	if (LEVEL == 1)
		return LIMIT_NONE;
	if (sequence.state == REST)
		return limits_of_rest(reading, &sequence.half);
	return limits_of_half(reading, &sequence.half, sequence.state == CHARGE, ended);
}

static void show(const struct reading *reading)
{
	line_begin();
	line_fixed(reading->millivolts, 3);
	line_char(';');
	line_fixed(reading->milliamperes, 3);
	line_char(';');
	line_fixed(half_energy(&sequence.half), 4);
	line_char(';');
	line_fixed(reading->tenths, 1);
	line_count();
	if (LEVEL == 2) {
		line_char(';');
		line_char(sequence.state == CHARGE ? 'C' : sequence.state == DISCHARGE ? 'D' : 'R');
	}
	line_send();
}

/* Go on from the end of a charge, a discharge, or a rest; the relays are open. */
static void next_half(uint32_t ticks)
{
	const enum state ended = sequence.state;
	if (ended == DISCHARGE && sequence.cycle >= settings[CYCLES]) {
		finish(ENDED);
		line_mark(FLASH("DISCHARGE END"));
		line_mark(FLASH("TEST END"));
		return;
	}
	if (ended != REST) {
		discharge_follows = ended == CHARGE;
		line_mark(discharge_follows ? FLASH("CHARGE END") : FLASH("DISCHARGE END"));
	}
	if (ended != REST && settings[REST_TIME])
		begin_half(REST);
	else if (discharge_follows)
		discharge(ticks);
	else
		charge(ticks);
}

static void data_line(uint32_t ticks)
{
	const struct reading reading = window_mean();
	half_add(&sequence.half, &reading, sequence.state == REST);
	const bool ended = half_ended(&reading);
	const enum limit reason = limit_of(&reading, ended);
	alarm_set(ALARM_LINE, ticks + TICKS_PER_LINE);
	if (reason || ended)
		relays_open();
	show(&reading);
	if (reason)
		trip(reason);
	else if (ended)
		next_half(ticks);
	window_begin(ticks);
}

static void idle_line(uint32_t ticks)
{
	alarm_set(ALARM_IDLE, ticks + TICKS_PER_LINE);
	if (sequence_runs())
		return;
	window_begin(ticks);
	if (LEVEL == 1)
		return;
	line_begin();
	sequence_state_name();
	if (sequence.state == TRIPPED) {
		line_char(' ');
		limit_name(sequence.reason);
	}
	line_count();
	line_send();
}

void sequence_alarm(uint8_t alarm, uint32_t ticks)
{
	lines_at(ticks);
	switch (alarm) {
	case ALARM_BEAT:
		trip(HEARTBEAT);
		break;
	case ALARM_CLOSE:
		relays_close();
		break;
	case ALARM_IDLE:
		idle_line(ticks);
		break;
	case ALARM_LINE:
		data_line(ticks);
		break;
	case ALARM_MEASURE:
		window_measure();
		break;
	case ALARM_LOOK:
		adc_look();
		break;
	}
}

void sequence_state_name(void)
{
	static const __flash char names[][10] = {"IDLE", "CHARGE", "REST", "DISCHARGE", "ENDED", "STOPPED", "TRIPPED"};
	line_flash(names[sequence.state]);
}
