/* The sum of sum.h over memory, the same as in image.py. A CRC of the image would take ten times as long. */
#ifndef CHECKSUM_H
#define CHECKSUM_H

#include <stdint.h>

#include "sum.h"

enum { CHECKSUM_START = 0x746f6d6f };

static inline uint32_t checksum_on(uint32_t sum, const volatile uint32_t *from, const volatile uint32_t *end)
{
    while (from < end)
        sum = sum_on(sum, *from++);
    return sum;
}

static inline uint32_t checksum_words(const volatile uint32_t *from, const volatile uint32_t *end)
{
    return checksum_on(CHECKSUM_START, from, end);
}

#endif
