/* Light and camera outputs: eight state machines behind pins that can be forced low. */
#ifndef OUTPUTS_H
#define OUTPUTS_H

#include <stdbool.h>
#include <stdint.h>

#include "pulse_train.h"

/* Every output driven low; the first thing after a reset. */
void outputs_start(void);

/* Set the currents, make the state machines wait for a shot with this train, and give their pins to them. False if an
 * edge is no multiple of a cycle or does not fit its field, if the set-points cannot be set, or if outputs_off came in
 * between; then the caller switches off. */
bool outputs_load(const struct pulse_train *train);

/* Start one shot of the loaded train; false, and no shot, if outputs_off came in between. */
bool outputs_fire(void);

/* Let the next rising edge of the trigger pin start one shot. */
void outputs_permit(void);

/* True once, when the permitted shot has started; also after outputs_off. */
bool outputs_take_start(void);

/* Rises of the camera outputs since the last call. */
uint32_t outputs_take_cameras(void);

/* As port_take_lights. */
uint32_t outputs_take_lights(void);

/* False from a shot on whose words have changed in memory, to the next train. */
bool outputs_intact(void);

/* All low, from any context, interrupts included: light pins first, then cameras, trigger, machines, set-points. */
void outputs_off(void);

/* What has to wait before it gives an output, as for set-points, asks how often the outputs were off, waits, and masks
 * the interrupts: true unless an OFF came meanwhile, which must not be undone. */
uint32_t outputs_switch_off(void);
bool outputs_mask_unless_off(uint32_t off_before, uint32_t *before);

/* With interrupts masked: the light pin of a channel to its state machine. */
void outputs_give_light(uint32_t channel);

#endif
