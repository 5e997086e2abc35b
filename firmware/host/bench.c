#include "bench.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

struct bench bench = {.serial = -1, .interlock_closed = true, .estop_closed = true};

const char port_build[] = "host";
const char port_git[] = REVISION;
const uint32_t port_tick_ns = 8; /* as the RP2040 at 125 MHz */
const uint32_t port_current_step_ma = 10;

enum { STORES = 64 };

static struct pulse_train loaded;
static uint32_t fired;
static bool permitted;
static struct port_edges edges;
static uint32_t cameras;
static uint32_t lights;
static uint32_t light_ma[CHANNEL_COUNT];
static bool lit;

void bench_power_up(void)
{
    port_off();
    fired = cameras = lights = 0;
    edges = (struct port_edges){0};
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

void bench_set_estop(bool closed)
{
    bench.estop_closed = closed;
    bench.estop_opened |= !closed;
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

const char *port_serial(void)
{
    return "simulated";
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

bool port_estop_closed(void)
{
    const bool closed = bench.estop_closed && !bench.estop_opened;
    bench.estop_opened = false;
    return closed;
}

bool port_set_points_confirmed(void)
{
    return !bench.converter_stuck;
}

bool port_load(const struct pulse_train *train)
{
    loaded = *train;
    permitted = false;
    edges = (struct port_edges){0};
    return true;
}

static void give_shot(void)
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
        cameras++;
        lights |= channel->current_ma ? 1u << i : 0u;
    }
    bench_print_event("fired %u%.*s\n", ++fired, (int)length, line);
}

bool port_fire(void)
{
    give_shot();
    return true;
}

void port_permit(void)
{
    permitted = true;
}

void bench_trigger(void)
{
    edges.rises++;
    if (permitted) {
        permitted = false;
        edges.fired = true;
        give_shot();
    }
}

struct port_edges port_take_edges(void)
{
    const struct port_edges taken = edges;
    edges = (struct port_edges){0};
    return taken;
}

uint32_t port_take_cameras(void)
{
    const uint32_t taken = cameras;
    cameras = 0;
    return taken;
}

uint32_t port_take_lights(void)
{
    const uint32_t taken = lights;
    lights = 0;
    return taken;
}

bool port_intact(void)
{
    return true;
}

bool port_read_stored(uint32_t words[STORED_WORDS])
{
    memcpy(words, bench.stored, sizeof bench.stored);
    return bench.any_stored;
}

void port_store(const uint32_t words[STORED_WORDS])
{
    if (bench.stores++ >= STORES)
        return;
    memcpy(bench.stored, words, sizeof bench.stored);
    bench.any_stored = true;
}

struct port_line_errors port_line_errors(void)
{
    return (struct port_line_errors){0};
}

bool port_clock_sound(void)
{
    return true;
}

bool port_prepare_light(const uint32_t *current_ma)
{
    memcpy(light_ma, current_ma, sizeof light_ma);
    return true;
}

void port_sustain_light(void)
{
    if (!lit)
        bench_print_event("lit 0 %u 1 %u 2 %u 3 %u\n", light_ma[0], light_ma[1], light_ma[2], light_ma[3]);
    lit = true;
    for (int i = 0; i < CHANNEL_COUNT; i++)
        lights |= light_ma[i] ? 1u << i : 0u;
}

void port_off(void)
{
    loaded = (struct pulse_train){0};
    permitted = false;
    if (lit)
        bench_print_event("dark\n");
    lit = false;
}

static void send_line(char *line, size_t length)
{
    if (bench.replies_to_lose) {
        bench.replies_to_lose--;
        return;
    }
    if (bench.replies_to_damage) {
        bench.replies_to_damage--;
        line[length / 2] = (char)(line[length / 2] ^ 1);
    }
    bench_send(line, length);
}

void port_send(char byte)
{
    static char line[512];
    static size_t length;
    if (length < sizeof line)
        line[length++] = byte;
    if (byte != '\n')
        return;
    send_line(line, length);
    length = 0;
}
