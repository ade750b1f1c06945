/* The serial line: 9600 baud, 8 data bits, no parity, 1 stop bit, both directions by interrupt. */
#ifndef UART_H
#define UART_H

#include "board.h"

/* How many bytes of the host wait. */
extern volatile uint8_t uart_waiting;

void uart_start(void);

/* Take the next byte of the host; call it only while some wait. */
uint8_t uart_take(void);

/* The tick at which the last byte came. */
uint32_t uart_arrived(void);

/* How many bytes can be sent without waiting. */
uint8_t uart_room(void);

/* Queue a byte; there must be room. */
void uart_send(uint8_t byte);

#endif
