#include "light_check.h"

#include "port.h"
#include "safety.h"
#include "shot_count.h"

static uint32_t bits_in(uint32_t lights)
{
    uint32_t count = 0;
    for (; lights; lights &= lights - 1u)
        count++;
    return count;
}

static void end_shot(struct generator *generator)
{
    generator->counters.lights += bits_in(generator->seen_lights);
    generator->shot_lights = generator->seen_lights = 0;
}

/* The pins are asked before the trigger input: what has lit them by now, has also been counted by then. */
void light_check_poll(struct generator *generator)
{
    const uint64_t now_us = port_now_us();
    const uint32_t seen = port_take_lights();
    shot_count_collect(generator);
    generator->seen_lights |= seen & generator->shot_lights;
    if (seen & ~(generator->shot_lights | generator->lit_lights) && !(generator->faults & FAULT_OUTPUT))
        safety_trip(generator, FAULT_OUTPUT);
    if (generator->shot_lights && now_us >= generator->train_over_us)
        end_shot(generator);
    if (generator->state != STATE_LIT)
        generator->lit_lights = 0;
}
