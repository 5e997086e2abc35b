#include "text.h"

static void put(struct text *text, char character)
{
    if (text->length < TEXT_SIZE)
        text->bytes[text->length++] = character;
}

void text_word(struct text *text, const char *word)
{
    while (*word)
        put(text, *word++);
}

void text_number(struct text *text, uint32_t number)
{
    char digits[10];
    size_t count = 0;
    do {
        digits[count++] = (char)('0' + (int)(number % 10u));
        number /= 10u;
    } while (number);
    while (count)
        put(text, digits[--count]);
}

void text_hex16(struct text *text, uint16_t number)
{
    for (int shift = 12; shift >= 0; shift -= 4)
        put(text, "0123456789ABCDEF"[(number >> shift) & 15]);
}

void text_field(struct text *text, const char *name, uint32_t number)
{
    put(text, ' ');
    text_word(text, name);
    put(text, '=');
    text_number(text, number);
}
