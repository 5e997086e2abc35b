/* Reading the few kinds of words that the protocol has, without stdio. */
#ifndef SPAN_H
#define SPAN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* A part of a received line; not terminated by zero. */
struct span {
    const char *start;
    size_t length;
};

/* Cut the next word, up to a space, off the front of the rest; empty at the end. Words are separated by one space. */
struct span span_next_word(struct span *rest);
bool span_equals(struct span span, const char *word);
bool span_number(struct span span, uint32_t *number); /* decimal, no sign, fits 32 bits */
bool span_hex16(struct span span, uint16_t *number);  /* exactly four digits 0-9 A-F */

#endif
