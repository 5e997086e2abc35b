/* A reply on its way out: what is written is sent at once, and nobody keeps it. */
#ifndef REPLY_H
#define REPLY_H

#include <stdint.h>

#include "generator_state.h"

struct reply {
    struct generator *generator; /* which lives on between the bytes: triggers and light do not wait for a reply */
    uint16_t crc;
    uint32_t polled_us;
};

struct reply reply_begin(struct generator *generator);
void reply_word(struct reply *reply, const char *word);
void reply_number(struct reply *reply, uint32_t number);

/* " name=number" for each of the names, which a space divides. */
void reply_fields(struct reply *reply, const char *names, const uint32_t *numbers);

/* CRC and line feed. */
void reply_end(struct reply *reply);

#endif
