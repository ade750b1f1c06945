#include "settings.h"

#include "crc.h"
#include "lines.h"

#define NAME_SIZE 7
#define LARGEST 100000000L

struct row {
	char name[NAME_SIZE];
	uint8_t decimals;
	int32_t usual, lowest, highest;
};

static const __flash struct row table[SETTINGS] = {
	[CYCLES] = {"cycles", 0, 10, 1, 9999},
	[REST_TIME] = {"rest", 0, 0, 0, 86400},
	[BEAT] = {"beat", 0, 60, 10, 600},
	[VFULL] = {"vfull", 3, 4150, 3000, 4250},
	[IEND] = {"iend", 3, 50, 5, 1000},
	[VEND] = {"vend", 3, 2700, 2500, 3600},
	[VMAX] = {"vmax", 3, 4250, 3000, 4300},
	[VMIN] = {"vmin", 3, 2600, 2300, 3600},
	[IMAX] = {"imax", 3, 1000, 10, 3000},
	[TMAX] = {"tmax", 1, 450, 0, 600},
	[TMIN] = {"tmin", 1, 0, -200, 400},
	[HALF_TIME] = {"time", 0, 28800, 60, 172800},
	[CHARGE_LIMIT] = {"charge", 3, 3000, 1, 10000},
};

static const __flash uint8_t ordered[][2] = {{VMIN, VEND}, {VEND, VFULL}, {VFULL, VMAX}, {IEND, IMAX}, {TMIN, TMAX}};

int32_t settings[SETTINGS];

void settings_reset(void)
{
	for (uint8_t each = 0; each < SETTINGS; each++)
		settings[each] = table[each].usual;
	if (LEVEL == 1)
		settings[CYCLES] = CYCLES_OF_A_TEST;
}

enum setting setting_find(const char *name, const char *end)
{
	for (uint8_t each = 0; each < SETTINGS; each++) {
		const __flash char *known = table[each].name;
		const char *place = name;
		while (*known && place < end && *place == *known) {
			place++;
			known++;
		}
		if (!*known && place == end)
			return each;
	}
	return SETTINGS;
}

static bool is_digit(char character)
{
	return character >= '0' && character <= '9';
}

/* Of a number beyond any range, only that matters. */
static int32_t with_digit(int32_t value, char digit)
{
	return value < LARGEST ? value * 10 + (digit - '0') : value;
}

bool setting_parse(enum setting setting, const char *text, int32_t *value)
{
	const bool negative = *text == '-';
	uint8_t decimals = table[setting].decimals;
	int32_t size = 0;
	text += negative;
	if (!is_digit(*text) || (*text == '0' && is_digit(text[1])))
		return false;
	while (is_digit(*text))
		size = with_digit(size, *text++);
	if (decimals && *text++ != '.')
		return false;
	for (; decimals; decimals--, text++) {
		if (!is_digit(*text))
			return false;
		size = with_digit(size, *text);
	}
	*value = negative ? -size : size;
	return !*text && !(negative && !size);
}

bool setting_allows(enum setting setting, int32_t value)
{
	return value >= table[setting].lowest && value <= table[setting].highest;
}

void setting_name(enum setting setting)
{
	line_flash(table[setting].name);
}

void setting_show(enum setting setting)
{
	setting_name(setting);
	line_char('=');
	line_fixed(settings[setting], table[setting].decimals);
}

/* The text is written into the line and taken back, one setting after the other. */
uint16_t settings_crc(void)
{
	uint16_t crc = CRC_BEGIN;
	for (uint8_t each = 0; each < SETTINGS; each++) {
		const uint8_t begin = line_length();
		if (each)
			line_char(';');
		setting_show(each);
		crc = line_crc(crc, begin);
		line_cut(begin);
	}
	return crc;
}

enum setting settings_contradiction(void)
{
	for (uint8_t each = 0; each < sizeof ordered / sizeof *ordered; each++) {
		if (settings[ordered[each][0]] >= settings[ordered[each][1]])
			return ordered[each][0];
	}
	return SETTINGS;
}
