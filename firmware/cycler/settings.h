/* The settings of level 2: whole numbers in units of their last digit, so that their text is exact. */
#ifndef SETTINGS_H
#define SETTINGS_H

#include "board.h"

enum setting {
	CYCLES, REST_TIME, BEAT, VFULL, IEND, VEND, VMAX, VMIN, IMAX, TMAX, TMIN, HALF_TIME, CHARGE_LIMIT, SETTINGS
};

extern int32_t settings[SETTINGS];

/* Be the defaults again. */
void settings_reset(void);

/* The setting of a name that ends at `end`, or SETTINGS if there is none. */
enum setting setting_find(const char *name, const char *end);

/* Read a value as the page writes it; return whether it is written so. */
bool setting_parse(enum setting setting, const char *text, int32_t *value);

bool setting_allows(enum setting setting, int32_t value);

/* Write `name=value` into the line. */
void setting_show(enum setting setting);

/* Write the name alone. */
void setting_name(enum setting setting);

/* The CRC of all settings as START names it. */
uint16_t settings_crc(void);

/* The first setting that is not below the one that it has to be below, or SETTINGS. */
enum setting settings_contradiction(void);

#endif
