#include "reset.h"

#include <avr/io.h>
#include <avr/wdt.h>

/* Kept when RAM is cleared at the start. */
static uint8_t flags __attribute__((section(".noinit")));

/*
 * A reset by the watchdog leaves it running at 16 ms, so it is stopped before anything else. A bootloader that clears
 * MCUSR hands over what it read in r2, as Optiboot does.
 */
__attribute__((naked, used, section(".init3"))) static void keep_flags(void)
{
	uint8_t handed_over;
	__asm__ volatile("mov %0, r2" : "=r"(handed_over));
	flags = MCUSR ? MCUSR : handed_over & 0xF0 ? 0 : handed_over;
	MCUSR = 0;
	wdt_disable();
}

const __flash char *reset_reason(void)
{
	if ((flags & _BV(BORF)) && !(flags & _BV(PORF)))
		return FLASH("BROWNOUT");
	if (flags & _BV(WDRF))
		return FLASH("WATCHDOG");
	if (flags & _BV(EXTRF))
		return FLASH("EXTERNAL");
	return flags & _BV(PORF) ? FLASH("POWER") : FLASH("UNKNOWN");
}
