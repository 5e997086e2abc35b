/* The timer: microseconds since it was started, and an alarm. */
#ifndef TIMER_H
#define TIMER_H

#include <stdint.h>

void timer_start(void);
uint64_t timer_now_us(void);

/* Interrupt after this time, once. With interrupts masked: an alarm that is set too late never comes. */
void timer_set_alarm(uint32_t time_us);
void timer_isr(void);

#endif
