/* Light and camera outputs: eight state machines behind pins that can be forced low. */
#ifndef OUTPUTS_H
#define OUTPUTS_H

#include "pulse_train.h"

/* Every output driven low; the first thing after a reset. */
void outputs_start(void);

/* Set the currents, make the state machines wait for a shot with this train, and give their pins to them. False if an
 * edge is no multiple of a cycle or does not fit its field, if the set-points cannot be set, or if outputs_off came in
 * between; then the caller switches off. */
bool outputs_load(const struct pulse_train *train);

/* Start one shot of the loaded train; nothing happens if outputs_off came in between. */
void outputs_fire(void);

/* All low, from any context, interrupts included: light pins first, then cameras, trigger, machines, set-points. */
void outputs_off(void);

#endif
