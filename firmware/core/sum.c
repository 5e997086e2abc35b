#include "sum.h"

uint32_t sum_of(const void *words, size_t size)
{
    const uint32_t *word = words;
    uint32_t sum = 0;
    for (size_t i = 0; i < size / sizeof *word; i++)
        sum = sum_on(sum, word[i]);
    return sum;
}
