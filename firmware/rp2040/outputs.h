/* Light and camera outputs: eight state machines behind pins that can be forced low. */
#ifndef OUTPUTS_H
#define OUTPUTS_H

#include "pulse_train.h"

/* Every output driven low; the first thing after a reset. */
void outputs_start(void);

/* Make the state machines wait for a shot with this train, and give their pins to them. False if an edge is no
 * multiple of a cycle or does not fit its field. */
bool outputs_load(const struct pulse_train *train);

/* Start one shot of the loaded train; nothing happens if outputs_off came in between. */
void outputs_fire(void);

/* All low, from any context, interrupts included: light pins first, then cameras, trigger, set-points, machines. */
void outputs_off(void);

#endif
