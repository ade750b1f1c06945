/* What adds up in a half-cycle or a rest. */
#ifndef HALF_H
#define HALF_H

#include "adc.h"
#include "board.h"

struct half {
	uint32_t lines;     /* data lines */
	uint32_t flow;      /* sum of |current| in mA */
	uint32_t energy;    /* 0.1 mWh */
	uint32_t remainder; /* what is not yet 0.1 mWh: |voltage x current| in uW over lines of 5 s */
	uint8_t row;        /* lines with a wrong current, one after the other */
};

/* Add a data line; a rest has no charge and no energy. */
void half_add(struct half *half, const struct reading *reading, bool rests);

/* The energy as a data line shows it, in units of 0.1 mWh. */
uint32_t half_energy(const struct half *half);

#endif
