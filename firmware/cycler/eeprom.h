/* What the board knows of itself without power: boot counter, serial number, coefficients. */
#ifndef EEPROM_H
#define EEPROM_H

#include "board.h"

#define SERIAL_LENGTH 8

struct coefficients {
	float a0, b0, a1, b1, a2; /* V, V, A, A, K */
};

extern uint32_t eeprom_boots;
extern char eeprom_serial[SERIAL_LENGTH + 1];
extern struct coefficients eeprom_coefficients;

/* Read everything; the boot counter is this start's already. */
void eeprom_read(void);

/* Keep the boot counter; takes 4 ms for each byte that changes. */
void eeprom_count_boot(void);

#endif
