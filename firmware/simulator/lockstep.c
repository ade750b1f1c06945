/*
 * An ATmega328P under simavr, driven step by step over its standard input and output.
 *
 * A test program: simavr is GPL-3, so that this is a process of its own which nothing else is linked to.
 * Numbers are little-endian. The host asks, the answer ends the step:
 *
 *   'R' u64 now, u64 limit, u16 sums[3], u16 n, n bytes    it is `now`, bytes of the host arrive; run to `limit` at most
 *   'B' u8 mcusr     a reset; mcusr is its reason
 *   'D' u8 dead      whether conversions never end
 *   'M'              answered by u32 cycles per byte, u16 stack bytes used, u16 RAM left, 32 bytes EEPROM
 *
 * R and B are answered by u64 cycle, u64 next (when the device wakes by itself), u16 n, n bytes of events. An event
 * is a letter, u64 cycle, u8 length and its bytes: 'T' a line with its \n, 'P' the relays (1 charge, 2 discharge),
 * 'W' a reset by the watchdog. The device runs on while it would wake before `limit`.
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "chip.h"

static FILE *answers;

static void get(void *data, size_t size)
{
	if (fread(data, 1, size, stdin) != size)
		exit(0);
}

static void put(const void *data, size_t size)
{
	fwrite(data, 1, size, answers);
}

static void answer(void)
{
	const uint64_t times[2] = {chip_cycle(), chip_next()};
	put(times, sizeof times);
	put(&chip_event_bytes, 2);
	put(chip_events, chip_event_bytes);
	chip_event_bytes = 0;
}

static void step(void)
{
	uint64_t times[2];
	uint16_t count;
	uint8_t bytes[UINT16_MAX];
	get(times, sizeof times);
	get(chip_sums, 6);
	get(&count, 2);
	get(bytes, count);
	chip_pass(times[0]);
	chip_receive(bytes, count);
	chip_run(times[1]);
	answer();
}

static void reset(void)
{
	uint8_t flags;
	get(&flags, 1);
	chip_reset(flags);
	answer();
}

static void tell(void)
{
	uint8_t image[EEPROM_BYTES];
	uint16_t memory[2];
	chip_memory(&memory[0], &memory[1]);
	chip_eeprom(image);
	put(&chip_baud_cycles, 4);
	put(memory, sizeof memory);
	put(image, sizeof image);
}

/* Arguments: the firmware, cycles for a byte of the host's line (0: as the firmware sets it), EEPROM in hexadecimal. */
int main(int count, char **arguments)
{
	uint8_t image[EEPROM_BYTES];
	char command;
	if (count != 4 || strlen(arguments[3]) != 2 * EEPROM_BYTES)
		return 2;
	for (int place = 0; place < EEPROM_BYTES; place++)
		sscanf(&arguments[3][2 * place], "%2hhx", &image[place]);
	/* simavr tells what it loads on standard output. */
	answers = fdopen(dup(STDOUT_FILENO), "wb");
	if (!answers || !freopen("/dev/null", "w", stdout))
		return 2;
	if (chip_make(arguments[1], strtoul(arguments[2], 0, 10), image))
		return 2;
	for (;;) {
		get(&command, 1);
		if (command == 'R')
			step();
		else if (command == 'B')
			reset();
		else if (command == 'D')
			get(&chip_converter_dead, 1);
		else if (command == 'M')
			tell();
		else
			return 6;
		fflush(answers);
	}
}
