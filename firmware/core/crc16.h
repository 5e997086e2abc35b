/* CRC-16/CCITT-FALSE: polynomial 0x1021, start 0xFFFF, check value of "123456789" is 0x29B1. */
#ifndef CRC16_H
#define CRC16_H

#include <stddef.h>
#include <stdint.h>

enum { CRC16_START = 0xFFFF };

uint16_t crc16_on(uint16_t crc, char byte); /* of one byte more */
uint16_t crc16(const char *bytes, size_t length);

#endif
