#include <string.h>

#include "clock.h"
#include "commands.h"
#include "crc.h"
#include "eeprom.h"
#include "level.h"
#include "lines.h"
#include "reset.h"
#include "uart.h"

#define LONGEST 63 /* without the \n */
#define SEAL_LENGTH 5

/* A \r before the \n is dropped, so that it needs a place. */
static char line[LONGEST + 2];
static uint8_t length;

void level_banner(void)
{
	line_begin();
	line_flash(FLASH("START ARDUINO"));
	line_count();
	line_flash(FLASH(";2.0;hil-cycler;" FIRMWARE_VERSION ";"));
	line_text(eeprom_serial);
	line_char(';');
	line_number(eeprom_boots);
	line_char(';');
	line_flash(reset_reason());
	line_send();
}

/* The value of four hexadecimal digits in capitals, or -1. */
static int32_t hex(const char *text)
{
	uint16_t value = 0;
	for (uint8_t place = 0; place < 4; place++, text++) {
		if (*text >= '0' && *text <= '9')
			value = value << 4 | (*text - '0');
		else if (*text >= 'A' && *text <= 'F')
			value = value << 4 | (*text - 'A' + 10);
		else
			return -1;
	}
	return value;
}

/* Whether the line is sealed by its CRC; the seal is cut off. */
static bool sealed(void)
{
	uint16_t crc = CRC_BEGIN;
	if (length <= SEAL_LENGTH || line[length - SEAL_LENGTH] != '*')
		return false;
	for (uint8_t place = 0; place < length - SEAL_LENGTH; place++)
		crc = crc_add(crc, line[place]);
	if (hex(&line[length - SEAL_LENGTH + 1]) != crc)
		return false;
	length -= SEAL_LENGTH;
	line[length] = 0;
	return true;
}

/* The command after the tag, or nothing if the line does not begin as it must. */
static char *after_tag(void)
{
	char *text = &line[1];
	uint32_t tag = 0;
	if (line[0] != ':' || *text < '0' || *text > '9' || (*text == '0' && text[1] != ' '))
		return 0;
	while (*text >= '0' && *text <= '9' && tag <= UINT16_MAX)
		tag = tag * 10 + (*text++ - '0');
	if (*text != ' ' || tag > UINT16_MAX)
		return 0;
	*text++ = 0;
	return text;
}

/* Cut a text at its single spaces; return how many words there are, 0 if they are not of the form. */
static uint8_t cut(char *text)
{
	uint8_t words = 1;
	bool empty = true;
	for (; *text; text++) {
		if (*text == ' ' && !empty) {
			*text = 0;
			words++;
			empty = true;
		} else if (*text >= '!' && *text <= '~') {
			empty = false;
		} else {
			return 0;
		}
	}
	return empty ? 0 : words;
}

static void take_line(void)
{
	char *words;
	uint8_t count;
	if (length && line[length - 1] == '\r')
		length--;
	if (!length)
		return;
	lines_at(uart_arrived());
	if (length <= LONGEST && sealed() && (words = after_tag()) && (count = cut(words)))
		command_execute(&line[1], words, count, uart_arrived());
	else
		line_mark(FLASH("ERROR FRAME"));
}

void level_receive(uint8_t byte)
{
	if (byte == '\n') {
		take_line();
		length = 0;
	} else if (length < sizeof line - 1) {
		line[length++] = byte;
	} else {
		/* Too long already: what ends it cannot make it a line again. */
		line[LONGEST] = line[LONGEST - 1] = 'x';
	}
}
