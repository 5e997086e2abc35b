/* The commands of the protocol. firmware/README.md is their table; a test compares the two. */
#ifndef COMMANDS_H
#define COMMANDS_H

#include <stdint.h>

#include "error.h"
#include "generator_state.h"
#include "reply.h"
#include "span.h"

#define MODEL "tomoshadow-pulse"
#define VERSION "4.0.0"

enum { PROTOCOL_VERSION = 4, MAX_FIELDS = 12, MAX_VALUES = 17 };

/* What a command has answered: an error, or the values of these names. */
struct answer {
    enum error error;
    const char *names;
    uint32_t values[MAX_VALUES];
};

/* Carry out one command, given its word and the rest of the line. */
void commands_run(struct generator *generator, struct span word, struct span rest, struct answer *answer);

/* Write what ID answers: the cause of the newest start and the number of the last answered line among it. */
void commands_identify(struct reply *reply, enum cause cause, uint32_t last_sequence);

#endif
