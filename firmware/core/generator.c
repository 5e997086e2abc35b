#include "generator.h"

#include "light.h"
#include "light_check.h"
#include "port.h"
#include "safety.h"
#include "shooting.h"

void generator_boot(struct generator *generator, enum cause cause)
{
    *generator = (struct generator){.state = STATE_SAFE};
    safety_outputs_off(generator);
    safety_start_limits(generator);
    (void)port_take_lights(); /* of what was before */
    if (cause == CAUSE_WATCHDOG)
        safety_trip(generator, FAULT_WATCHDOG);
}

void generator_poll(struct generator *generator)
{
    const uint64_t now_us = port_now_us();
    safety_watch(generator, now_us);
    light_check_poll(generator);
    generator->counters.cameras += port_take_cameras();
    shooting_poll(generator);
    light_poll(generator);
    if (generator->state == STATE_SAFE && generator->outputs_live && now_us >= generator->train_over_us)
        safety_outputs_off(generator);
}

uint32_t generator_idle_us(const struct generator *generator)
{
    const uint64_t now_us = port_now_us();
    const uint64_t due_us = shooting_due_us(generator);
    const uint32_t longest_us = generator->outputs_live ? LIVE_POLL_US : POLL_US;
    if (due_us <= now_us)
        return 0;
    return due_us - now_us < longest_us ? (uint32_t)(due_us - now_us) : longest_us;
}
