#include "crc16.h"

static uint16_t shifted(uint16_t crc)
{
    const uint16_t doubled = (uint16_t)(crc << 1);
    return (crc & 0x8000u) ? (uint16_t)(doubled ^ 0x1021u) : doubled;
}

uint16_t crc16_on(uint16_t crc, char byte)
{
    crc = (uint16_t)(crc ^ (uint16_t)((uint8_t)byte << 8));
    for (int bit = 0; bit < 8; bit++)
        crc = shifted(crc);
    return crc;
}

uint16_t crc16(const char *bytes, size_t length)
{
    uint16_t crc = CRC16_START;
    for (size_t i = 0; i < length; i++)
        crc = crc16_on(crc, bytes[i]);
    return crc;
}
