/* Looks at the light outputs themselves: high where nothing was asked for is a fault, whoever drives them. */
#ifndef LIGHT_CHECK_H
#define LIGHT_CHECK_H

#include "generator_state.h"

/* For generator_poll. */
void light_check_poll(struct generator *generator);

#endif
