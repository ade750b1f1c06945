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

#include <simavr/avr_adc.h>
#include <simavr/avr_eeprom.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_cycle_timers.h>
#include <simavr/sim_elf.h>
#include <simavr/sim_io.h>

#define FREQUENCY 16000000
#define ADCSRA 0x7A
#define ADEN 0x80
#define BROKEN_CYCLES 100
#define MCUSR 0x54
#define PORTB_ADDRESS 0x25
#define PORTD_ADDRESS 0x2B
#define RAM_BEGIN 0x100
#define UNTOUCHED 0xA5
#define EEPROM_BYTES 32
#define CONVERSIONS 64
#define MOST_EVENTS 60000

static FILE *answers;
static avr_t *avr;
static avr_run_t usual_run;
static avr_uart_t *uart;
static avr_irq_t *rx, *inputs;
static uint32_t baud_cycles, pace;
static uint8_t events[MOST_EVENTS + 300], queue[4096], line[256];
static uint16_t event_bytes, queue_first, queue_last, sums[3];
static uint8_t line_length, pins, conversion[3], dead, resetting;
static uint64_t line_began;
static uint16_t ram_used_to;

static void get(void *data, size_t size)
{
	if (fread(data, 1, size, stdin) != size)
		exit(0);
}

static void event(char kind, uint64_t cycle, const uint8_t *data, uint8_t length)
{
	if (event_bytes > MOST_EVENTS)
		exit(3);
	events[event_bytes++] = kind;
	memcpy(&events[event_bytes], &cycle, 8);
	events[event_bytes + 8] = length;
	memcpy(&events[event_bytes + 9], data, length);
	event_bytes += 9 + length;
}

static void sent(struct avr_irq_t *irq, uint32_t value, void *param)
{
	(void)irq, (void)param;
	if (!line_length)
		line_began = avr->cycle;
	line[line_length++] = value;
	if (value == '\n' || line_length == 255) {
		event('T', line_began, line, line_length);
		line_length = 0;
	}
}

static void look_at_pins(struct avr_irq_t *irq, uint32_t value, void *param)
{
	(void)irq, (void)value, (void)param;
	const uint8_t *data = avr->data;
	const uint8_t charge = data[PORTD_ADDRESS] & data[PORTD_ADDRESS - 1] & 0x80;
	const uint8_t discharge = data[PORTB_ADDRESS] & data[PORTB_ADDRESS - 1] & 0x01;
	const uint8_t now = (charge ? 1 : 0) | (discharge ? 2 : 0);
	if (now != pins)
		event('P', avr->cycle, &now, 1);
	pins = now;
}

/* A converter without power does not end what it began. */
static avr_cycle_count_t break_off(avr_t *self, avr_cycle_count_t when, void *param)
{
	(void)when, (void)param;
	self->data[ADCSRA] &= ~ADEN;
	return 0;
}

/* Conversions differ by one so that any 64 in a row have the wanted sum, as noise does it on a board. */
static void converting(struct avr_irq_t *irq, uint32_t value, void *param)
{
	union {
		avr_adc_mux_t mux;
		uint32_t value;
	} trigger = {.value = value};
	(void)irq, (void)param;
	const uint8_t input = trigger.mux.src;
	if (dead)
		avr_cycle_timer_register(avr, BROKEN_CYCLES, break_off, 0);
	if (input > 2)
		return;
	const uint32_t place = conversion[input]++ % CONVERSIONS;
	const uint32_t counts = sums[input] * (place + 1) / CONVERSIONS - sums[input] * place / CONVERSIONS;
	avr_raise_irq(inputs + ADC_IRQ_ADC0 + input, (counts * 5000 + 1022) / 1023);
}

static avr_cycle_count_t feed(avr_t *self, avr_cycle_count_t when, void *param)
{
	(void)self, (void)param;
	avr_raise_irq(rx, queue[queue_first++]);
	if (queue_first == queue_last) {
		queue_first = queue_last = 0;
		return 0;
	}
	return when + uart->cycles_per_byte;
}

/* All pins of a device under reset are inputs; what it was sending is torn. */
static void was_reset(avr_io_t *io)
{
	(void)io;
	const uint8_t open = 0;
	if (!resetting)
		event('W', avr->cycle, &open, 0);
	if (line_length)
		event('T', line_began, line, line_length);
	if (pins)
		event('P', avr->cycle, &open, 1);
	pins = line_length = 0;
	queue_first = queue_last = 0;
}

static avr_io_t watcher = {.kind = "watcher", .reset = was_reset};

/* avr_run lets 1 + `cycles` pass behind this; time passes in `skip` and `pass` only, so it is taken back. */
static void no_sleep(avr_t *self, avr_cycle_count_t cycles)
{
	self->cycle -= 1 + cycles;
}

static uint64_t next_wake(void)
{
	return avr->cycle_timers.timer ? avr->cycle_timers.timer->when : UINT64_MAX;
}

/* The watchdog resets a device that sleeps at its next run, for which it replaces the function. */
static int asleep(void)
{
	return avr->state == cpu_Sleeping && !avr->interrupt_state && avr->run == usual_run;
}

/* The firmware sets its speed; where the line of the host has a speed of its own, bytes are only passed on. */
static void keep_pace(void)
{
	if (uart->cycles_per_byte == pace)
		return;
	baud_cycles = uart->cycles_per_byte;
	if (pace && baud_cycles)
		uart->cycles_per_byte = pace;
}

/* An event that wakes nobody leaves the device asleep. */
static void skip(void)
{
	if (avr->cycle < next_wake())
		avr->cycle = next_wake();
	avr_cycle_timer_process(avr);
}

static void run(uint64_t limit)
{
	while (avr->cycle < limit) {
		if (asleep()) {
			if (next_wake() > limit)
				return;
			skip();
			if (asleep())
				continue;
		}
		avr_run(avr);
		keep_pace();
		if (avr->state == cpu_Done || avr->state == cpu_Crashed)
			exit(4);
	}
}

/* A device that sleeps notices nothing of the time until its next wake. */
static void pass(uint64_t now)
{
	if (asleep() && avr->cycle < now && next_wake() > now)
		avr->cycle = now;
}

static void answer(void)
{
	const uint64_t times[2] = {avr->cycle, asleep() ? next_wake() : avr->cycle};
	fwrite(times, 8, 2, answers);
	fwrite(&event_bytes, 2, 1, answers);
	fwrite(events, 1, event_bytes, answers);
	fflush(answers);
	event_bytes = 0;
}

static void reset(void)
{
	uint8_t flags;
	get(&flags, 1);
	resetting = 1;
	avr_reset(avr);
	resetting = 0;
	avr->data[MCUSR] = flags;
	answer();
}

static void tell(void)
{
	uint8_t image[EEPROM_BYTES];
	avr_eeprom_desc_t description = {.ee = image, .offset = 0, .size = EEPROM_BYTES};
	uint16_t lowest = ram_used_to;
	while (lowest < avr->ramend && avr->data[lowest] == UNTOUCHED)
		lowest++;
	const uint16_t stack[2] = {avr->ramend + 1 - lowest, lowest - ram_used_to};
	avr_ioctl(avr, AVR_IOCTL_EEPROM_GET, &description);
	fwrite(&baud_cycles, 4, 1, answers);
	fwrite(stack, 2, 2, answers);
	fwrite(image, 1, EEPROM_BYTES, answers);
	fflush(answers);
}

static void step(void)
{
	uint64_t times[2];
	uint16_t count;
	get(times, 16);
	get(sums, 6);
	get(&count, 2);
	if (queue_last + count > (int)sizeof queue)
		exit(5);
	get(&queue[queue_last], count);
	pass(times[0]);
	if (count && !queue_last)
		avr_cycle_timer_register(avr, 1, feed, 0);
	queue_last += count;
	run(times[1]);
	answer();
}

static void connect_all(void)
{
	uint32_t flags = 0;
	avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
	for (avr_io_t *io = avr->io_port; io; io = io->next)
		if (!strcmp(io->kind, "uart"))
			uart = (avr_uart_t *)io;
	rx = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
	inputs = avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, 0);
	avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), sent, 0);
	avr_irq_register_notify(inputs + ADC_IRQ_OUT_TRIGGER, converting, 0);
	avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('D'), 7), look_at_pins, 0);
	avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('B'), 0), look_at_pins, 0);
	avr_register_io(avr, &watcher);
}

/* Arguments: the firmware, cycles for a byte of the host's line (0: as the firmware sets it), EEPROM in hexadecimal. */
int main(int count, char **arguments)
{
	elf_firmware_t firmware = {0};
	uint8_t image[EEPROM_BYTES];
	avr_eeprom_desc_t description = {.ee = image, .offset = 0, .size = EEPROM_BYTES};
	char command;
	if (count != 4 || strlen(arguments[3]) != 2 * EEPROM_BYTES)
		return 2;
	/* simavr tells what it loads on standard output. */
	answers = fdopen(dup(STDOUT_FILENO), "wb");
	if (!answers || !freopen("/dev/null", "w", stdout))
		return 2;
	if (elf_read_firmware(arguments[1], &firmware))
		return 2;
	pace = strtoul(arguments[2], 0, 10);
	for (int place = 0; place < EEPROM_BYTES; place++)
		sscanf(&arguments[3][2 * place], "%2hhx", &image[place]);
	strcpy(firmware.mmcu, "atmega328p");
	firmware.frequency = FREQUENCY;
	avr = avr_make_mcu_by_name(firmware.mmcu);
	avr_init(avr);
	avr->log = LOG_NONE;
	avr->sleep = no_sleep;
	usual_run = avr->run;
	avr_load_firmware(avr, &firmware);
	avr->vcc = avr->avcc = avr->aref = 5000;
	avr_ioctl(avr, AVR_IOCTL_EEPROM_SET, &description);
	ram_used_to = RAM_BEGIN + firmware.datasize + firmware.bsssize + 4;
	memset(&avr->data[ram_used_to], UNTOUCHED, avr->ramend + 1 - ram_used_to);
	connect_all();
	for (;;) {
		get(&command, 1);
		if (command == 'R') {
			step();
		} else if (command == 'B') {
			reset();
		} else if (command == 'D') {
			get(&dead, 1);
		} else if (command == 'M') {
			tell();
		} else {
			return 6;
		}
	}
}
