#include "commands.h"

#include <avr/pgmspace.h>
#include <string.h>

#include "eeprom.h"
#include "fields.h"
#include "lines.h"
#include "relays.h"
#include "reset.h"
#include "sequence.h"
#include "settings.h"

/* When the command came. */
static uint32_t came;

static void line_run(void)
{
	if (sequence.has_run)
		line_hex(sequence.run, 8);
	else
		line_char('-');
}

static bool refuse_with_run(const __flash char *name)
{
	refuse(name);
	line_run();
	line_send();
	return true;
}

static bool refuse_running(void)
{
	return sequence_runs() && refuse_with_run(FLASH("BUSY"));
}

static bool refuse_state(void)
{
	refuse(FLASH("STATE"));
	sequence_state_name();
	line_send();
	return true;
}

static void reply_run(void)
{
	reply(FLASH(" OK run="));
	line_run();
	line_send();
}

static void identify(void)
{
	if (refuse_surplus())
		return;
	reply(FLASH(" OK level=2.0 name=hil-cycler firmware=" FIRMWARE_VERSION " serial="));
	line_text(eeprom_serial);
	line_flash(FLASH(" boots="));
	line_number(eeprom_boots);
	line_flash(FLASH(" reset="));
	line_flash(reset_reason());
	line_send();
}

static void tell_reading(const struct reading *reading)
{
	line_flash(FLASH(" v="));
	line_fixed(reading->millivolts, 3);
	line_flash(FLASH(" i="));
	line_fixed(reading->milliamperes, 3);
	line_flash(FLASH(" e="));
	line_fixed(half_energy(&sequence.half), 4);
	line_flash(FLASH(" t="));
	line_fixed(reading->tenths, 1);
}

static void tell_state(void)
{
	if (refuse_surplus())
		return;
	const struct reading reading = adc_measure();
	reply(FLASH(" OK state="));
	sequence_state_name();
	line_flash(FLASH(" run="));
	line_run();
	line_flash(FLASH(" cycle="));
	line_number(sequence.cycle);
	line_flash(FLASH(" relays="));
	line_char(relays_letter());
	line_flash(FLASH(" lines="));
	line_number(lines_number);
	line_flash(FLASH(" ms="));
	line_number(lines_milliseconds());
	tell_reading(&reading);
	line_send();
}

static void show_setting(enum setting setting)
{
	reply(FLASH(" OK "));
	setting_show(setting);
	line_send();
}

static void get(void)
{
	const char *name = next_field();
	const enum setting setting = name ? setting_find(name, name + strlen(name)) : SETTINGS;
	if (setting == SETTINGS) {
		refuse_field(name);
		return;
	}
	if (!refuse_surplus())
		show_setting(setting);
}

static void change(void)
{
	const char *text = next_field();
	const char *end = text ? strchrnul(text, '=') : 0;
	const enum setting setting = text ? setting_find(text, end) : SETTINGS;
	int32_t value;
	if (setting == SETTINGS || !*end || !setting_parse(setting, end + 1, &value)) {
		refuse_field(text);
		return;
	}
	if (refuse_surplus())
		return;
	if (!setting_allows(setting, value)) {
		refuse(FLASH("RANGE"));
		setting_name(setting);
		line_send();
		return;
	}
	if (refuse_running())
		return;
	settings[setting] = value;
	show_setting(setting);
}

static bool refuse_settings(uint16_t named)
{
	line_begin();
	const uint16_t crc = settings_crc();
	const enum setting wrong = settings_contradiction();
	if (named != crc) {
		refuse(FLASH("SETTINGS"));
		line_hex(crc, 4);
	} else if (wrong != SETTINGS) {
		refuse(FLASH("ORDER"));
		setting_name(wrong);
	} else {
		return false;
	}
	line_send();
	return true;
}

static bool refuse_reading(void)
{
	const struct reading reading = adc_measure();
	const enum limit limit = limits_of_reading(&reading);
	if (!limit)
		return false;
	refuse(FLASH("LIMIT"));
	limit_name(limit);
	line_send();
	return true;
}

static void start(void)
{
	uint32_t run, named;
	if (refuse_hex("run=", 8, &run) || refuse_hex("settings=", 4, &named) || refuse_surplus())
		return;
	if (sequence_runs() && run == sequence.run) {
		sequence_beat(came);
		reply_run();
		return;
	}
	if (refuse_running() || (sequence.state != IDLE && refuse_state()))
		return;
	if (sequence.has_run && run == sequence.run && refuse_with_run(FLASH("RUN")))
		return;
	if (refuse_settings(named) || refuse_reading())
		return;
	sequence.run = run;
	sequence.has_run = true;
	reply_run();
	sequence_begin(came);
}

static void beat(void)
{
	uint32_t run;
	if (refuse_hex("run=", 8, &run) || refuse_surplus())
		return;
	if (!sequence_runs() && refuse_state())
		return;
	if (run != sequence.run && refuse_with_run(FLASH("RUN")))
		return;
	sequence_beat(came);
	reply_run();
}

static void reply_state(void)
{
	reply(FLASH(" OK state="));
	sequence_state_name();
	line_send();
}

static void stop(void)
{
	if (refuse_surplus())
		return;
	const bool ran = sequence_runs();
	relays_open();
	if (ran)
		sequence_stop();
	reply_state();
	if (ran)
		line_mark(FLASH("TEST STOPPED"));
}

static void clear(void)
{
	if (refuse_surplus() || refuse_running())
		return;
	sequence_clear();
	reply_state();
}

static const __flash struct {
	char name[6];
	void (*action)(void);
} commands[] = {
	{"BEAT", beat}, {"CLEAR", clear}, {"GET", get},          {"ID", identify},
	{"SET", change}, {"START", start}, {"STATE", tell_state}, {"STOP", stop},
};

void command_execute(const char *tag, const char *words, uint8_t count, uint32_t ticks)
{
	fields_begin(tag, words, count);
	came = ticks;
	for (uint8_t each = 0; each < sizeof commands / sizeof *commands; each++) {
		if (!strcmp_P(words, commands[each].name)) {
			commands[each].action();
			return;
		}
	}
	refuse(FLASH("COMMAND"));
	line_word(words, false);
	line_send();
}
