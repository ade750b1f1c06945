#include "eeprom.h"

#include <avr/eeprom.h>
#include <string.h>

#define BOOTS_AT ((uint32_t *)0)
#define SERIAL_AT ((const void *)4)
#define COEFFICIENTS_AT ((const void *)12)

uint32_t eeprom_boots;
char eeprom_serial[SERIAL_LENGTH + 1];
struct coefficients eeprom_coefficients;

static const struct coefficients usual = {0.0f, 10.0f, -5.0f, 10.0f, 0.0f};

/* An erased EEPROM is all FF; the serial number of such a board is told as `-`. */
static void read_serial(void)
{
	uint8_t length = 0;
	eeprom_read_block(eeprom_serial, SERIAL_AT, SERIAL_LENGTH);
	while (length < SERIAL_LENGTH && ((eeprom_serial[length] >= '0' && eeprom_serial[length] <= '9') ||
	                                  (eeprom_serial[length] >= 'A' && eeprom_serial[length] <= 'Z')))
		length++;
	if (!length)
		eeprom_serial[length++] = '-';
	eeprom_serial[length] = 0;
}

void eeprom_read(void)
{
	uint8_t erased = 0xFF;
	const uint8_t *bytes = (const uint8_t *)&eeprom_coefficients;
	eeprom_boots = eeprom_read_dword(BOOTS_AT) + 1;
	read_serial();
	eeprom_read_block(&eeprom_coefficients, COEFFICIENTS_AT, sizeof eeprom_coefficients);
	for (uint8_t place = 0; place < sizeof eeprom_coefficients; place++)
		erased &= bytes[place];
	if (erased == 0xFF)
		eeprom_coefficients = usual;
}

void eeprom_count_boot(void)
{
	eeprom_update_dword(BOOTS_AT, eeprom_boots);
}
