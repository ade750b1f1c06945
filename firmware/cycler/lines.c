#include "lines.h"

#include "clock.h"
#include "crc.h"
#include "relays.h"
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

/* No line is as long as this; one that were would be cut rather than written past the end. */
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

/* The processor cannot divide: each power of ten is taken away as often as it goes. */
static void decimal(uint32_t number, uint8_t decimals)
{
	static const __flash uint32_t powers[] = {1,      10,      100,      1000,      10000,
	                                          100000, 1000000, 10000000, 100000000, 1000000000};
	bool begun = false;
	for (uint8_t place = sizeof powers / sizeof *powers; place--;) {
		const uint32_t power = powers[place];
		char digit = '0';
		for (; number >= power; digit++)
			number -= power;
		begun |= digit != '0' || place <= decimals;
		if (begun)
			line_char(digit);
		if (decimals && place == decimals)
			line_char('.');
	}
}

void line_number(uint32_t number)
{
	decimal(number, 0);
}

void line_hex(uint32_t number, uint8_t digits)
{
	while (digits--) {
		const uint8_t digit = number >> 4 * digits & 0xF;
		line_char(digit < 10 ? '0' + digit : 'A' + digit - 10);
	}
}

void line_fixed(int32_t value, uint8_t decimals)
{
	if (value < 0)
		line_char('-');
	decimal(value < 0 ? -(uint32_t)value : (uint32_t)value, decimals);
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
			relays_guard();
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
