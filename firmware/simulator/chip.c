#include "chip.h"

#include <stdlib.h>
#include <string.h>

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
#define CONVERSIONS 64
#define CYCLES_AT_ONCE 1000 /* 62 us: so far a device that is awake may run beyond its limit */

uint8_t chip_events[MOST_EVENTS + 300];
uint16_t chip_event_bytes, chip_sums[3];
uint8_t chip_converter_dead;
uint32_t chip_baud_cycles;

static avr_t *avr;
static avr_run_t usual_run;
static avr_uart_t *uart;
static avr_irq_t *rx, *inputs;
static uint32_t pace;
static uint8_t queue[4096], line[256];
static uint16_t queue_first, queue_last;
static uint8_t line_length, pins, conversion[3], resetting;
static uint64_t line_began;
static uint16_t ram_used_to;

static void event(char kind, uint64_t cycle, const uint8_t *data, uint8_t length)
{
	if (chip_event_bytes > MOST_EVENTS)
		exit(3);
	chip_events[chip_event_bytes++] = kind;
	memcpy(&chip_events[chip_event_bytes], &cycle, 8);
	chip_events[chip_event_bytes + 8] = length;
	memcpy(&chip_events[chip_event_bytes + 9], data, length);
	chip_event_bytes += 9 + length;
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
	if (chip_converter_dead)
		avr_cycle_timer_register(avr, BROKEN_CYCLES, break_off, 0);
	if (input > 2)
		return;
	const uint32_t place = conversion[input]++ % CONVERSIONS;
	const uint32_t counts = chip_sums[input] * (place + 1) / CONVERSIONS - chip_sums[input] * place / CONVERSIONS;
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
	chip_baud_cycles = uart->cycles_per_byte;
	if (pace && chip_baud_cycles)
		uart->cycles_per_byte = pace;
}

/* An event that wakes nobody leaves the device asleep. */
static void skip(void)
{
	if (avr->cycle < next_wake())
		avr->cycle = next_wake();
	avr_cycle_timer_process(avr);
}

/* A reset lets simavr run single instructions again. */
void chip_run(uint64_t limit)
{
	avr->run_cycle_limit = CYCLES_AT_ONCE;
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
void chip_pass(uint64_t now)
{
	if (asleep() && avr->cycle < now && next_wake() > now)
		avr->cycle = now;
}

uint64_t chip_cycle(void)
{
	return avr->cycle;
}

uint64_t chip_next(void)
{
	return asleep() ? next_wake() : avr->cycle;
}

void chip_receive(const uint8_t *bytes, uint16_t count)
{
	if (queue_last + count > (int)sizeof queue)
		exit(5);
	memcpy(&queue[queue_last], bytes, count);
	if (count && !queue_last)
		avr_cycle_timer_register(avr, 1, feed, 0);
	queue_last += count;
}

void chip_reset(uint8_t flags)
{
	resetting = 1;
	avr_reset(avr);
	resetting = 0;
	avr->data[MCUSR] = flags;
}

void chip_memory(uint16_t *stack, uint16_t *untouched)
{
	uint16_t lowest = ram_used_to;
	while (lowest < avr->ramend && avr->data[lowest] == UNTOUCHED)
		lowest++;
	*stack = avr->ramend + 1 - lowest;
	*untouched = lowest - ram_used_to;
}

void chip_eeprom(uint8_t image[EEPROM_BYTES])
{
	avr_eeprom_desc_t description = {.ee = image, .offset = 0, .size = EEPROM_BYTES};
	avr_ioctl(avr, AVR_IOCTL_EEPROM_GET, &description);
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

int chip_make(const char *path, uint32_t cycles_per_byte, uint8_t image[EEPROM_BYTES])
{
	elf_firmware_t firmware = {0};
	avr_eeprom_desc_t description = {.ee = image, .offset = 0, .size = EEPROM_BYTES};
	if (elf_read_firmware(path, &firmware))
		return -1;
	pace = cycles_per_byte;
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
	return 0;
}
