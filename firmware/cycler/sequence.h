/* The test: half-cycles, their ends, and what is measured when. */
#ifndef SEQUENCE_H
#define SEQUENCE_H

#include "board.h"
#include "limits.h"

enum state { IDLE, CHARGE, REST, DISCHARGE, ENDED, STOPPED, TRIPPED };

struct sequence {
	enum state state;
	enum limit reason;
	uint32_t run;
	bool has_run;
	uint16_t cycle;
	struct half half;
};

extern struct sequence sequence;

void sequence_start(void);

bool sequence_runs(void);

/* Begin a test at a tick; the mark is sent. */
void sequence_begin(uint32_t ticks);

/* End a test because the host wants it; relays first, the mark is the caller's. */
void sequence_stop(void);

/* Be ready for another test. */
void sequence_clear(void);

/* Take a heartbeat that came at a tick. */
void sequence_beat(uint32_t ticks);

/* Do what is due: `alarm` was set for this tick. */
void sequence_alarm(uint8_t alarm, uint32_t ticks);

/* Write the name of the state into the line. */
void sequence_state_name(void);

#endif
