/* CRC-16/IBM-3740: polynomial 1021, initial value FFFF, no reflection, no final XOR. */
#ifndef CRC_H
#define CRC_H

#include "board.h"

#define CRC_BEGIN 0xFFFF

uint16_t crc_add(uint16_t crc, uint8_t byte);

#endif
