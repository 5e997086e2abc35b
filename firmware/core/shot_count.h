/* What became of the shots: counters, budget, and the time that the next one has to wait. */
#ifndef SHOT_COUNT_H
#define SHOT_COUNT_H

#include "generator_state.h"

/* A shot has started. Called after the start: starting takes time, and the end must not be cut off. */
void shot_count_fired(struct generator *generator);

/* Count what the trigger input has done. */
void shot_count_collect(struct generator *generator);

#endif
