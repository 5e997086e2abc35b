/* Current set-points of the LED drivers: PWM at 41.7 kHz in steps of 10 mA, full scale is MAX_CURRENT_MA. */
#ifndef SET_POINTS_H
#define SET_POINTS_H

#include "pulse_train.h"

void set_points_start(void);
void set_points_set(const struct pulse_train *train);
void set_points_zero(void);

#endif
