/* Current set-points of the LED drivers, in steps of 10 mA. Two implementations: set_points_dac.c, a converter that is
 * read back, and set_points_pwm.c, for a board without one. */
#ifndef SET_POINTS_H
#define SET_POINTS_H

#include <stdbool.h>
#include <stdint.h>

#include "limits.h"

enum { SET_POINT_STEP_MA = 10 };

/* From the main loop, once the clocks run. */
void set_points_start(void);

/* From the main loop, with interrupts on: set all channels, and read them back where that is possible. Takes up to 1 ms
 * with a converter that works, SET_POINTS_LIMIT_MS with one that does not; then false. An OFF that comes meanwhile is
 * answered by false or by set-points that the caller has to zero again. */
bool set_points_set(const uint32_t current_ma[CHANNEL_COUNT]);

/* To zero, from any context, without waiting. */
void set_points_zero(void);

/* From the main loop, all the time, also while it sends a reply: goes on until the zero that was asked for reads back, and
 * looks from time to time whether what was set still does. */
void set_points_poll(void);

/* False from set-points that do not read back to the first ones that do. */
bool set_points_confirmed(void);

#endif
