#include "half.h"

#include <stdlib.h>

#define UW_LINES_PER_DIGIT 72000UL /* 0.1 mWh is 100 uWh; a line of 1 uW is 5 / 3600 uWh */

void half_add(struct half *half, const struct reading *reading, bool rests)
{
	half->lines++;
	if (rests)
		return;
	half->flow += abs(reading->milliamperes);
	half->remainder += (uint32_t)abs(reading->millivolts) * abs(reading->milliamperes);
	half->energy += half->remainder / UW_LINES_PER_DIGIT;
	half->remainder %= UW_LINES_PER_DIGIT;
}

uint32_t half_energy(const struct half *half)
{
	return half->energy + (half->remainder >= UW_LINES_PER_DIGIT / 2);
}
