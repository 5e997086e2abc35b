#include "bench.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "port.h"

struct bench bench = {.serial = -1, .interlock_closed = true};

const char port_build[] = "host";
const char port_serial[] = "simulated";
const uint32_t port_tick_ns = 8; /* as the RP2040 at 125 MHz */

static struct pulse_train loaded;
static uint32_t fired;

void bench_power_up(void)
{
    loaded = (struct pulse_train){0};
    fired = 0;
}

void bench_find_port(void)
{
    bench.clock_offset_us += 100000;
}

void bench_set_interlock(bool closed)
{
    bench.interlock_closed = closed;
    bench.interlock_opened |= !closed;
}

void bench_print_event(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vprintf(format, arguments);
    va_end(arguments);
    fflush(stdout);
}

void bench_send(const char *bytes, size_t length)
{
    /* A host that does not read loses replies, as on a wire; the core must not wait for it. */
    ssize_t written = write(bench.serial, bytes, length);
    (void)written;
}

uint64_t port_now_us(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)(now.tv_sec * 1000000 + now.tv_nsec / 1000 + bench.clock_offset_us);
}

bool port_interlock_closed(void)
{
    const bool closed = bench.interlock_closed && !bench.interlock_opened;
    bench.interlock_opened = false;
    return closed;
}

bool port_load(const struct pulse_train *train)
{
    loaded = *train;
    return true;
}

void port_fire(void)
{
    char line[512];
    size_t length = 0;
    for (int i = 0; i < CHANNEL_COUNT; i++) {
        const struct channel *channel = &loaded.channels[i];
        if (!channel->used)
            continue;
        const int added = snprintf(line + length, sizeof line - length, " %d %u %u %u %u %u %u", i, channel->camera_ns,
                                   channel->a_start_ns, channel->a_width_ns, channel->b_start_ns, channel->b_width_ns,
                                   channel->current_ma);
        length += (size_t)added;
    }
    bench_print_event("fired %u%.*s\n", ++fired, (int)length, line);
}

void port_off(void)
{
    loaded = (struct pulse_train){0};
}

void port_send(const char *bytes, size_t length)
{
    char sent[512];
    if (bench.replies_to_lose) {
        bench.replies_to_lose--;
        return;
    }
    if (length > sizeof sent)
        length = sizeof sent;
    memcpy(sent, bytes, length);
    if (bench.replies_to_damage) {
        bench.replies_to_damage--;
        sent[length / 2] = (char)(sent[length / 2] ^ 1);
    }
    bench_send(sent, length);
}
