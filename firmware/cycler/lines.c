#include "lines.h"

#include "clock.h"
#include "crc.h"
#include "sequence.h"
#include "uart.h"

#define LONGEST 140

uint32_t lines_number;

static char line[LONGEST];
static uint8_t length;
static uint32_t milliseconds;

void lines_at(uint32_t ticks)
{
	milliseconds = clock_milliseconds(ticks);
}

uint32_t lines_milliseconds(void)
{
	return milliseconds;
}

void line_begin(void)
{
	length = 0;
}

/* No line is as long as this; one that were would be cut rather than written behind the end. */
void line_char(char character)
{
	if (length < LONGEST)
		line[length++] = character;
}

void line_text(const char *text)
{
	while (*text)
		line_char(*text++);
}

void line_flash(const __flash char *text)
{
	while (*text)
		line_char(*text++);
}

/* Digits come from behind; at least `least` of them, with a point before the last `decimals`. */
static void digits(uint32_t number, uint8_t base, uint8_t least, uint8_t decimals)
{
	char reversed[12];
	uint8_t count = 0, written = 0;
	while (number || written < least) {
		if (decimals && written == decimals)
			reversed[count++] = '.';
		const uint8_t digit = number % base;
		reversed[count++] = digit < 10 ? '0' + digit : 'A' + digit - 10;
		number /= base;
		written++;
	}
	while (count)
		line_char(reversed[--count]);
}

void line_number(uint32_t number)
{
	digits(number, 10, 1, 0);
}

void line_hex(uint32_t number, uint8_t least)
{
	digits(number, 16, least, 0);
}

void line_fixed(int32_t value, uint8_t decimals)
{
	if (value < 0)
		line_char('-');
	digits(value < 0 ? -(uint32_t)value : (uint32_t)value, 10, decimals + 1, decimals);
}

void line_count(void)
{
	if (LEVEL == 1)
		return;
	line_char(';');
	line_number(++lines_number);
	line_char(';');
	line_number(milliseconds);
}

static void send(char character)
{
	static const volatile uint8_t never;
	if (!uart_room())
		clock_arm();
	while (!uart_room()) {
		clock_sleep(&never);
		if (clock_rang)
			sequence_guard();
	}
	uart_send(character);
}

uint8_t line_length(void)
{
	return length;
}

void line_cut(uint8_t shorter)
{
	length = shorter;
}

uint16_t line_crc(uint16_t crc, uint8_t from)
{
	for (uint8_t place = from; place < length; place++)
		crc = crc_add(crc, line[place]);
	return crc;
}

void line_send(void)
{
	if (LEVEL == 2) {
		const uint16_t crc = line_crc(CRC_BEGIN, 0);
		line_char('*');
		line_hex(crc, 4);
	}
	for (uint8_t place = 0; place < length; place++)
		send(line[place]);
	send('\r');
	send('\n');
}

void line_mark(const __flash char *text)
{
	line_begin();
	line_flash(text);
	line_count();
	line_send();
}
