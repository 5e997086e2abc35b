/* The commands of the protocol. firmware/README.md is their table; a test compares the two. */
#ifndef COMMANDS_H
#define COMMANDS_H

#include <stdint.h>

#include "error.h"
#include "generator_state.h"
#include "span.h"
#include "text.h"

#define MODEL "tomoshadow-pulse"
#define VERSION "3.0.0"

enum { PROTOCOL_VERSION = 3, MAX_FIELDS = 9 };

/* Carry out one command, given its word and the rest of the line; append the fields of the reply. */
enum error commands_run(struct generator *generator, struct span word, struct span rest, struct text *reply);

/* Append what ID answers: the cause of the newest start and the number of the last answered line among it. */
void commands_identify(struct text *reply, enum cause cause, uint32_t last_sequence);

#endif
