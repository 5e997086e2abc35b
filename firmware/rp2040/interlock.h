/* The inputs that act in the interrupt, before the core knows: interlock and emergency stop, whose falling edge
 * switches the outputs off, and the trigger pin, whose rises are counted. */
#ifndef INTERLOCK_H
#define INTERLOCK_H

#include <stdbool.h>

#include "port.h"

void interlock_start(void);
void interlock_isr(void);
bool interlock_take_closed(void);             /* as port_interlock_closed */
bool interlock_take_estop_closed(void);       /* as port_estop_closed */
struct port_edges interlock_take_edges(void); /* as port_take_edges */

#endif
