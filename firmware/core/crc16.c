#include "crc16.h"

/* Division by x^16 + x^12 + x^5 + 1, eight bits at once: what the upper byte leaves meets itself again four bits on. */
uint16_t crc16_on(uint16_t crc, char byte)
{
    const uint32_t upper = (uint32_t)(crc >> 8) ^ (uint8_t)byte;
    const uint32_t quotient = upper ^ upper >> 4;
    return (uint16_t)((uint32_t)crc << 8 ^ quotient << 12 ^ quotient << 5 ^ quotient);
}

uint16_t crc16(const char *bytes, size_t length)
{
    uint16_t crc = CRC16_START;
    for (size_t i = 0; i < length; i++)
        crc = crc16_on(crc, bytes[i]);
    return crc;
}
