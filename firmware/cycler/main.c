/* The battery cycler: start, and then whatever is due. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>

#include "adc.h"
#include "board.h"
#include "clock.h"
#include "eeprom.h"
#include "level.h"
#include "lines.h"
#include "relays.h"
#include "sequence.h"
#include "uart.h"

/* Kept over the clearing of RAM. */
static uint8_t reset_flags __attribute__((section(".noinit")));

/*
 * A reset by the watchdog leaves it running at 16 ms, so that it is stopped before anything else. Where a bootloader
 * cleared MCUSR it hands over what it read in r2, as Optiboot does.
 */
__attribute__((naked, used, section(".init3"))) static void keep_reset_flags(void)
{
	uint8_t handed_over;
	__asm__ volatile("mov %0, r2" : "=r"(handed_over));
	reset_flags = MCUSR ? MCUSR : handed_over & 0xF0 ? 0 : handed_over;
	MCUSR = 0;
	wdt_disable();
}

int main(void)
{
	enum alarm alarm;
	uint32_t due;
	relays_start();
	clock_start();
	wdt_enable(WDTO_2S);
	uart_start();
	adc_start();
	eeprom_read();
	sequence_start();
	sei();
	level_banner(reset_flags);
	eeprom_count_boot();
	for (;;) {
		if (alarm_take(&alarm, &due))
			sequence_alarm(alarm, due);
		else if (uart_waiting)
			level_receive(uart_take());
		else if (clock_arm())
			clock_wait(&uart_waiting);
	}
}
