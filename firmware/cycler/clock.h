/* Device time in ticks of 64 us, and alarms that wake the device. */
#ifndef CLOCK_H
#define CLOCK_H

#include "board.h"

#define TICKS_PER_S 15625UL
#define TICKS_PER_LINE (5 * TICKS_PER_S)

/* In the order in which they are served where two are due at once. */
enum alarm { ALARM_BEAT, ALARM_CLOSE, ALARM_IDLE, ALARM_LINE, ALARM_MEASURE, ALARM_LOOK, ALARMS };

void clock_start(void);

/* Ticks since the start, 32 bits: they wrap after 76 h, only differences mean something. */
uint32_t clock_ticks(void);

/* The tick at which TCNT1 was `stamp`, which may be up to 4 s ago. */
uint32_t clock_of_stamp(uint16_t stamp);

/* Device time in ms of a tick of the last or next hours, rounded; 32 bits, from 0 again after 49.7 days. */
uint32_t clock_milliseconds(uint32_t ticks);

void alarm_set(enum alarm alarm, uint32_t due);
void alarm_clear(enum alarm alarm);
bool alarm_passed(enum alarm alarm);

/* Take the first alarm that is due; return whether there was one, with the tick for which it was set. */
bool alarm_take(enum alarm *alarm, uint32_t *due);

/* Let the timer interrupt at the next alarm; return false if it is due already. */
bool clock_arm(void);

/* Whether the alarm for which the timer was armed came. */
extern volatile uint8_t clock_rang;

/* Sleep until `ready` is set or the alarm came, through all interrupts in between. */
void clock_wait(const volatile uint8_t *ready);

/* Sleep until any interrupt, unless `ready` is set or the alarm came already. */
void clock_sleep(const volatile uint8_t *ready);

#endif
