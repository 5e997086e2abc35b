/* The blocks of the chip, which start and stop one by one. */
#ifndef RESETS_H
#define RESETS_H

#include <stdint.h>

/* Put these blocks into reset and take them out again: whatever they did before, they now do nothing. */
void resets_restart(uint32_t reset_bits);

#endif
