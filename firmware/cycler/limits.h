/* What ends a test of level 2 because it is not as it must be. */
#ifndef LIMITS_H
#define LIMITS_H

#include "adc.h"
#include "board.h"
#include "half.h"

enum limit {
	LIMIT_NONE, SENSOR, OVER_VMAX, UNDER_VMIN, OVER_IMAX, OVER_TMAX, UNDER_TMIN, TIME, CHARGE_MOVED, CURRENT, RELAY,
	HEARTBEAT
};

/* The limit that a reading alone passes. */
enum limit limits_of_reading(const struct reading *reading);

/* The limit that a data line of a charge or discharge passes. */
enum limit limits_of_half(const struct reading *reading, struct half *half, bool charging, bool ended);

/* The limit that a data line of a rest passes. */
enum limit limits_of_rest(const struct reading *reading, struct half *half);

/* Write the name of a limit into the line. */
void limit_name(enum limit limit);

#endif
