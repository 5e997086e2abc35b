/* The interlock input. Its falling edge switches the outputs off in the interrupt, before the core knows. */
#ifndef INTERLOCK_H
#define INTERLOCK_H

#include <stdbool.h>

void interlock_start(void);
bool interlock_take_closed(void); /* as port_interlock_closed */

#endif
