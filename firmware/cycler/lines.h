/* Lines of the device: text and numbers, then number, time and CRC where the level has them. */
#ifndef LINES_H
#define LINES_H

#include "board.h"

/* The number of the last numbered line. */
extern uint32_t lines_number;

/* All lines from here on are made at this tick of device time. */
void lines_at(uint32_t ticks);

/* The ms of the lines. */
uint32_t lines_milliseconds(void);

void line_begin(void);
void line_char(char character);
void line_text(const char *text);
void line_flash(const __flash char *text);
void line_number(uint32_t number);
void line_hex(uint32_t number, uint8_t digits);

/* Write a number of units of the last digit. */
void line_fixed(int32_t value, uint8_t decimals);

/* Write number and time in level 2, and nothing in level 1. */
void line_count(void);

/* Write CRC and end, and send it; the line stays whole. */
void line_send(void);

/* The bytes of the line so far; `line_cut` throws away what follows a length. */
uint8_t line_length(void);
void line_cut(uint8_t length);

/* Add the bytes from a place on to a CRC. */
uint16_t line_crc(uint16_t crc, uint8_t from);

/* Send a mark of one text. */
void line_mark(const __flash char *text);

#endif
