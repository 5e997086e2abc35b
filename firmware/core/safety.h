/* Whether light is allowed: the train and its limits, the stops, and what takes the permission away. What gives light is
 * in shooting.h and light.h; nothing else does. */
#ifndef SAFETY_H
#define SAFETY_H

#include <stdbool.h>
#include <stdint.h>

#include "generator_state.h"

/* Loading: only while SAFE. Quantises, checks requested and actual values, keeps the actual ones. */
enum error safety_new_train(struct generator *generator);
enum error safety_set_channel(struct generator *generator, uint32_t number, const struct channel *requested);
enum error safety_load(struct generator *generator);

/* At the start: the limits that the board has stored, and no train. Damaged ones are a fault. */
void safety_start_limits(struct generator *generator);

/* Tighten the limits of a channel; what is larger than the present limit changes nothing. The train must be loaded
 * again. Not while ARMED or LIT. */
enum error safety_tighten(struct generator *generator, uint32_t number, const struct channel_limits *asked);

/* Whether the memory of the board may be asked, which takes its time: not while ARMED or LIT, nor under a train. */
enum error safety_check_dark(const struct generator *generator);

/* Store the limits of all channels in the board, and start with them. Only while dark. */
enum error safety_store_limits(struct generator *generator, const struct channel_limits *limits);

void safety_off(struct generator *generator);
enum error safety_clear(struct generator *generator);

/* A command of the host has been carried out. */
void safety_heard(struct generator *generator);

/* The host has gone, as far as the port can tell: no silence needs to be waited for. */
void safety_hung_up(struct generator *generator);

/* Look at inputs, set-points and host, and latch what is wrong. */
void safety_watch(struct generator *generator, uint64_t now_us);

/* For those that give light. All reading of the stops goes through here: the port tells each opening once. */
enum error safety_check_safe(const struct generator *generator);
enum error safety_check_stops(struct generator *generator);
enum error safety_check_train(const struct generator *generator);

/* False, and a fault, where train or limits are not what they were when they were set. */
bool safety_check_memory(struct generator *generator);

/* What is left of making ready for light, while ARMED or LIT: a stop that has opened meanwhile trips, and hardware that is
 * not ready is switched off. */
enum error safety_made_ready(struct generator *generator, bool ready);
void safety_outputs_off(struct generator *generator);
void safety_trip(struct generator *generator, enum fault fault);

#endif
