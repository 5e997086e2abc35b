/* Light for adjustment: pulses of one program, as long as words come. */
#ifndef CONTINUOUS_LIGHT_H
#define CONTINUOUS_LIGHT_H

#include <stdbool.h>
#include <stdint.h>

/* Make ready for continuous light, dark until words come; false as outputs_load. */
bool continuous_light_prepare(const uint32_t *current_ma);

/* Permit the next few milliseconds of it. */
void continuous_light_sustain(void);

#endif
