#include "span.h"

struct span span_next_word(struct span *rest)
{
    struct span word = {rest->start, 0};
    while (word.length < rest->length && word.start[word.length] != ' ')
        word.length++;
    const size_t used = word.length < rest->length ? word.length + 1 : word.length;
    rest->start += used;
    rest->length -= used;
    return word;
}

bool span_equals(struct span span, const char *word)
{
    for (size_t i = 0; i < span.length; i++)
        if (!word[i] || word[i] != span.start[i])
            return false;
    return !word[span.length];
}

bool span_number(struct span span, uint32_t *number)
{
    uint32_t value = 0;
    if (span.length == 0 || span.length > 10)
        return false;
    for (size_t i = 0; i < span.length; i++) {
        if (span.start[i] < '0' || span.start[i] > '9')
            return false;
        const uint32_t digit = (uint32_t)(span.start[i] - '0');
        if (value > (UINT32_MAX - digit) / 10u)
            return false;
        value = value * 10u + digit;
    }
    *number = value;
    return true;
}

static int hex_digit(char character)
{
    if (character >= '0' && character <= '9')
        return character - '0';
    return character >= 'A' && character <= 'F' ? character - 'A' + 10 : -1;
}

bool span_hex16(struct span span, uint16_t *number)
{
    unsigned value = 0;
    for (size_t i = 0; i < span.length; i++) {
        const int digit = hex_digit(span.start[i]);
        if (digit < 0)
            return false;
        value = value << 4 | (unsigned)digit;
    }
    *number = (uint16_t)value;
    return span.length == 4;
}
