/* Restarts the whole chip, PIO and pads included, when the main loop does not come round; and knows of restarts. */
#ifndef WATCHDOG_H
#define WATCHDOG_H

#include <stdint.h>

#include "generator_state.h"

enum { WATCHDOG_MS = 200 }; /* the longest reply takes 30 */

struct start {
    uint32_t boot; /* differs from that of the start before */
    enum cause cause;
};

/* Once, after a reset, before watchdog_start. */
struct start watchdog_read_start(void);
void watchdog_start(void);
void watchdog_feed(void);

#endif
