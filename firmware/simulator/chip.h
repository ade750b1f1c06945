/* An ATmega328P under simavr, whose time passes only as far as it is let. */
#ifndef CHIP_H
#define CHIP_H

#include <stdint.h>

#define EEPROM_BYTES 32
#define MOST_EVENTS 60000

/* What happened since it was last taken: a letter, u64 cycle, u8 length and its bytes each. */
extern uint8_t chip_events[];
extern uint16_t chip_event_bytes;

/* What 64 conversions of each input add up to, and whether conversions never end. */
extern uint16_t chip_sums[3];
extern uint8_t chip_converter_dead;

/* Cycles for a byte as the firmware set them. */
extern uint32_t chip_baud_cycles;

/* Load a firmware; bytes take so many cycles, or with 0 as many as it sets. Returns 0, or -1 if it cannot be read. */
int chip_make(const char *path, uint32_t cycles_per_byte, uint8_t image[EEPROM_BYTES]);

/* Reset it; `flags` is what MCUSR tells then. */
void chip_reset(uint8_t flags);

/* Let time pass to `now` while it sleeps. */
void chip_pass(uint64_t now);

/* Let bytes of the host arrive from now on. */
void chip_receive(const uint8_t *bytes, uint16_t count);

/* Run until it sleeps beyond `limit`, or until `limit`. */
void chip_run(uint64_t limit);

/* What time it is, and when it goes on by itself. */
uint64_t chip_cycle(void);
uint64_t chip_next(void);

/* The deepest stack so far, and RAM between it and the variables that was never touched, in bytes. */
void chip_memory(uint16_t *stack, uint16_t *untouched);

void chip_eeprom(uint8_t image[EEPROM_BYTES]);

#endif
