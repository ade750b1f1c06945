#include "uart.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>
#include <util/setbaud.h>

#include "clock.h"

#define IN_SIZE 128 /* two lines of a host */
#define OUT_SIZE 256

volatile uint8_t uart_waiting;

static volatile uint8_t in[IN_SIZE], out[OUT_SIZE];
static volatile uint8_t in_last, out_first, out_last;
static volatile uint16_t stamp;
static uint8_t in_first;

ISR(USART_RX_vect)
{
	const uint8_t byte = UDR0;
	stamp = TCNT1;
	if (uart_waiting < IN_SIZE) {
		in[in_last] = byte;
		in_last = (in_last + 1) & (IN_SIZE - 1);
		uart_waiting++;
	}
}

ISR(USART_UDRE_vect)
{
	UDR0 = out[out_first];
	if (++out_first == out_last)
		UCSR0B &= ~_BV(UDRIE0);
}

void uart_start(void)
{
	UBRR0 = UBRR_VALUE;
	UCSR0A = USE_2X ? _BV(U2X0) : 0;
	UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
	UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
}

uint8_t uart_take(void)
{
	const uint8_t byte = in[in_first];
	in_first = (in_first + 1) & (IN_SIZE - 1);
	ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
		uart_waiting--;
	}
	return byte;
}

uint32_t uart_arrived(void)
{
	uint16_t when;
	ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
		when = stamp;
	}
	return clock_of_stamp(when);
}

uint8_t uart_room(void)
{
	return out_first - out_last - 1;
}

void uart_send(uint8_t byte)
{
	out[out_last] = byte;
	ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
		out_last++;
		UCSR0B |= _BV(UDRIE0);
	}
}
