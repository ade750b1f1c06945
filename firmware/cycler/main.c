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
	level_banner();
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
