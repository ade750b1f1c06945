#include "clock.h"
#include "level.h"
#include "lines.h"
#include "sequence.h"
#include "uart.h"

void level_banner(void)
{
	line_mark(FLASH("START ARDUINO"));
}

/* Any byte starts a device that waits; what comes later is ignored. */
void level_receive(uint8_t byte)
{
	const uint32_t arrived = uart_arrived();
	(void)byte;
	if (sequence.state != IDLE)
		return;
	lines_at(arrived);
	sequence_begin(arrived);
}
