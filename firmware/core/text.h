/* Writing the few kinds of words that the protocol has, without stdio. */
#ifndef TEXT_H
#define TEXT_H

#include <stddef.h>
#include <stdint.h>

enum { TEXT_SIZE = 288 };

/* A line being written. What does not fit is cut; the longest reply is far shorter. */
struct text {
    char bytes[TEXT_SIZE];
    size_t length;
};

void text_word(struct text *text, const char *word);
void text_number(struct text *text, uint32_t number);
void text_hex16(struct text *text, uint16_t number);
void text_field(struct text *text, const char *name, uint32_t number); /* " name=number" */

#endif
