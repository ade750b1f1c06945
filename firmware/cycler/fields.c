#include "fields.h"

#include <string.h>

#include "lines.h"

#define LONGEST_WORD 16

/* The fields that are left. */
static const char *tag, *field;
static uint8_t fields;

void fields_begin(const char *of_tag, const char *command, uint8_t words)
{
	tag = of_tag;
	field = command + strlen(command) + 1;
	fields = words - 1;
}

void reply(const __flash char *text)
{
	line_begin();
	line_char(':');
	line_text(tag);
	line_flash(text);
}

void refuse(const __flash char *name)
{
	reply(FLASH(" ERROR "));
	line_flash(name);
	line_char(' ');
}

void line_word(const char *word, bool of_field)
{
	for (uint8_t left = LONGEST_WORD; *word && left && !(of_field && *word == '='); left--, word++)
		line_char(*word == '*' ? '?' : *word);
}

bool refuse_field(const char *wrong)
{
	refuse(FLASH("FIELD"));
	if (wrong)
		line_word(wrong, true);
	else
		line_char('-');
	line_send();
	return true;
}

const char *next_field(void)
{
	const char *word = field;
	if (!fields)
		return 0;
	fields--;
	field += strlen(field) + 1;
	return word;
}

bool refuse_surplus(void)
{
	return fields && refuse_field(next_field());
}

bool refuse_hex(const char *name, uint8_t digits, uint32_t *value)
{
	const char *word = next_field(), *text = word;
	*value = 0;
	while (text && *name && *text == *name) {
		text++;
		name++;
	}
	if (!text || *name || strlen(text) != digits)
		return refuse_field(word);
	for (; *text; text++) {
		if (*text >= '0' && *text <= '9')
			*value = *value << 4 | (*text - '0');
		else if (*text >= 'A' && *text <= 'F')
			*value = *value << 4 | (*text - 'A' + 10);
		else
			return refuse_field(word);
	}
	return false;
}
