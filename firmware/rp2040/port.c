/* The port of the core to the RP2040: everything that the core asks of its machine, and who does it. */
#include "port.h"

#include "clock_check.h"
#include "clocks.h"
#include "continuous_light.h"
#include "flash_records.h"
#include "identity.h"
#include "image_check.h"
#include "interlock.h"
#include "outputs.h"
#include "serial.h"
#include "set_points.h"
#include "timer.h"

/* From the Makefile. */
const char port_build[] = BUILD_NAME;
const char port_git[] = REVISION;
const uint32_t port_tick_ns = TICK_NS;
const uint32_t port_current_step_ma = SET_POINT_STEP_MA;

const char *port_serial(void)
{
    return identity_serial();
}

uint64_t port_now_us(void)
{
    return timer_now_us();
}

bool port_interlock_closed(void)
{
    return interlock_take_closed();
}

bool port_estop_closed(void)
{
    return interlock_take_estop_closed();
}

bool port_set_points_confirmed(void)
{
    set_points_poll(); /* a reply keeps the main loop for longer than a look may take */
    return set_points_confirmed();
}

bool port_load(const struct pulse_train *train)
{
    (void)interlock_take_edges(); /* they are of no concern to this train */
    return outputs_load(train);
}

bool port_fire(void)
{
    return outputs_fire();
}

void port_permit(void)
{
    outputs_permit();
}

struct port_edges port_take_edges(void)
{
    return interlock_take_edges();
}

uint32_t port_take_cameras(void)
{
    return outputs_take_cameras();
}

uint32_t port_take_lights(void)
{
    return outputs_take_lights();
}

bool port_intact(void)
{
    return image_check_intact() && outputs_intact();
}

bool port_read_stored(uint32_t words[STORED_WORDS])
{
    return flash_records_read(words);
}

void port_store(const uint32_t words[STORED_WORDS])
{
    flash_records_append(words);
}

struct port_line_errors port_line_errors(void)
{
    return (struct port_line_errors){serial_errors.framing, serial_errors.breaks, serial_errors.overruns,
                                     serial_errors.lost};
}

bool port_clock_sound(void)
{
    return clock_check_sound();
}

bool port_prepare_light(const uint32_t *current_ma)
{
    return continuous_light_prepare(current_ma);
}

void port_sustain_light(void)
{
    continuous_light_sustain();
}

void port_off(void)
{
    outputs_off();
}

void port_send(char byte)
{
    serial_send(byte);
}
