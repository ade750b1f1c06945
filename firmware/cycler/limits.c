#include "limits.h"

#include <stdlib.h>

#include "lines.h"
#include "settings.h"

#define COLDEST (-400)
#define HOTTEST 1250
#define LINE_S 5
#define S_PER_H 3600
#define LINES_WITHOUT_CURRENT 12
#define LINES_WITHOUT_REST 3

enum limit limits_of_reading(const struct reading *reading)
{
	if (reading->tenths < COLDEST || reading->tenths > HOTTEST)
		return SENSOR;
	if (reading->millivolts > settings[VMAX])
		return OVER_VMAX;
	if (reading->millivolts < settings[VMIN])
		return UNDER_VMIN;
	if (abs(reading->milliamperes) > settings[IMAX])
		return OVER_IMAX;
	if (reading->tenths > settings[TMAX])
		return OVER_TMAX;
	return reading->tenths < settings[TMIN] ? UNDER_TMIN : LIMIT_NONE;
}

/* Count lines with a wrong current; return whether there were as many as `most` one after the other. */
static bool in_a_row(struct half *half, bool wrong, uint8_t most)
{
	half->row = wrong ? half->row + 1 : 0;
	return half->row >= most;
}

enum limit limits_of_half(const struct reading *reading, struct half *half, bool charging, bool ended)
{
	const enum limit limit = limits_of_reading(reading);
	const bool full = charging && reading->millivolts >= settings[VFULL];
	const bool wrong = !full && abs(reading->milliamperes) < settings[IEND];
	const bool without_current = in_a_row(half, wrong, LINES_WITHOUT_CURRENT);
	if (limit)
		return limit;
	if (!ended && half->lines * LINE_S > (uint32_t)settings[HALF_TIME])
		return TIME;
	if (half->flow * LINE_S > (uint32_t)settings[CHARGE_LIMIT] * S_PER_H)
		return CHARGE_MOVED;
	return without_current ? CURRENT : LIMIT_NONE;
}

enum limit limits_of_rest(const struct reading *reading, struct half *half)
{
	const enum limit limit = limits_of_reading(reading);
	const bool wrong = abs(reading->milliamperes) > settings[IEND];
	const bool flowing = in_a_row(half, wrong, LINES_WITHOUT_REST);
	if (limit)
		return limit;
	return flowing ? RELAY : LIMIT_NONE;
}

void limit_name(enum limit limit)
{
	static const __flash char names[][10] = {"",     "SENSOR", "VMAX",   "VMIN",    "IMAX",  "TMAX",
	                                         "TMIN", "TIME",   "CHARGE", "CURRENT", "RELAY", "HEARTBEAT"};
	line_flash(names[limit]);
}
