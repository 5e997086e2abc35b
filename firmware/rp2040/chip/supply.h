/* The supply of the core, which the chip watches by itself. */
#ifndef SUPPLY_H
#define SUPPLY_H

/* Once, with the outputs off: raise the voltage below which the chip resets itself. A chip that does not take it is not
 * run. */
void supply_start(void);

#endif
