#include "crc.h"

#include <util/crc16.h>

uint16_t crc_add(uint16_t crc, uint8_t byte)
{
	return _crc_xmodem_update(crc, byte);
}
