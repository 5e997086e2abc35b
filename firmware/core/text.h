/* Writing and reading the few kinds of words that the protocol has, without stdio. */
#ifndef TEXT_H
#define TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { TEXT_SIZE = 320 };

/* A line being written. What does not fit is cut; the longest reply is far shorter. */
struct text {
    char bytes[TEXT_SIZE];
    size_t length;
};

void text_word(struct text *text, const char *word);
void text_number(struct text *text, uint32_t number);
void text_hex16(struct text *text, uint16_t number);
void text_field(struct text *text, const char *name, uint32_t number); /* " name=number" */

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
