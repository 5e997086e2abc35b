/* A sum over words, the same as in image.py. Each step can be undone, so that no change of a single word is missed, whatever
 * bits of it; of other changes one in 2^32 is. A CRC of the image would take ten times as long. */
#ifndef CHECKSUM_H
#define CHECKSUM_H

#include <stdint.h>

enum { CHECKSUM_START = 0x746f6d6f };

static inline uint32_t checksum_step(uint32_t sum, uint32_t word)
{
    const uint32_t mixed = (sum ^ word) * 0x9e3779b1u;
    return mixed >> 13 | mixed << 19;
}

static inline uint32_t checksum_on(uint32_t sum, const volatile uint32_t *from, const volatile uint32_t *end)
{
    while (from < end)
        sum = checksum_step(sum, *from++);
    return sum;
}

static inline uint32_t checksum_words(const volatile uint32_t *from, const volatile uint32_t *end)
{
    return checksum_on(CHECKSUM_START, from, end);
}

#endif
