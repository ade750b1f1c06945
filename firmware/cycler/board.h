/* What the board is: pins, speed, and which level of the protocol is built. */
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stdint.h>

#ifndef LEVEL
#error "build with LEVEL=1 or LEVEL=2"
#endif

#define FIRMWARE_VERSION "1.0.0"
#define BAUD 9600

/* Cycles of a test of level 1, where nobody can say otherwise. */
#ifndef CYCLES_OF_A_TEST
#define CYCLES_OF_A_TEST 10
#endif

#define CHARGE_PORT PORTD
#define CHARGE_DDR DDRD
#define CHARGE_PIN 7
#define DISCHARGE_PORT PORTB
#define DISCHARGE_DDR DDRB
#define DISCHARGE_PIN 0

/* A text that stays in flash; RAM has no room to spare for words. */
#define FLASH(text) (__extension__({ static const __flash char flash_text[] = text; &flash_text[0]; }))

#endif
