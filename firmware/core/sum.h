/* A sum over words, by which a change in memory is found. Each step can be undone, so that no change of a single word is
 * missed; of other changes one in 2^32 is. */
#ifndef SUM_H
#define SUM_H

#include <stddef.h>
#include <stdint.h>

static inline uint32_t sum_on(uint32_t sum, uint32_t word)
{
    const uint32_t mixed = (sum ^ word) * 0x9e3779b1u;
    return mixed >> 13 | mixed << 19;
}

/* Of something that consists of words alone. */
uint32_t sum_of(const void *words, size_t size);

#endif
