#include "fake_port.h"

#include <string.h>

#include "crc16.h"

struct fake_port fake;

const char port_build[] = "test";
const char port_git[] = "unknown";
const uint32_t port_tick_ns = 8;
const uint32_t port_current_step_ma = 10;

void fake_reset(void)
{
    fake = (struct fake_port){.interlock_closed = true, .estop_closed = true, .can_load = true};
}

static void start_shot(void)
{
    fake.fired++;
    for (int i = 0; i < CHANNEL_COUNT; i++) {
        const struct channel *channel = &fake.loaded.channels[i];
        fake.cameras += channel->used;
        fake.lights |= channel->used && channel->current_ma ? 1u << i : 0u;
    }
}

void fake_edge(void)
{
    fake.rises++;
    if (fake.permitted) {
        fake.permitted = false;
        fake.edge_fired = true;
        start_shot();
    }
}

bool fake_lit(void)
{
    return fake.live && fake.now_us < fake.lit_until_us;
}

const char *port_serial(void)
{
    return "0";
}

uint64_t port_now_us(void)
{
    return fake.now_us;
}

bool port_interlock_closed(void)
{
    return fake.interlock_closed;
}

bool port_estop_closed(void)
{
    return fake.estop_closed;
}

bool port_set_points_confirmed(void)
{
    return !fake.set_points_stuck;
}

static bool is_ready(void)
{
    const bool ready = fake.can_load && !fake.opens;
    if (fake.opens)
        *fake.opens = false;
    fake.opens = NULL;
    return ready;
}

bool port_load(const struct pulse_train *train)
{
    CHECK(pulse_train_check(train) == ERROR_NONE);
    fake.loaded = *train;
    fake.prepared = false;
    fake.edge_fired = false;
    fake.rises = 0;
    fake.live = true; /* also where only a part could be loaded */
    return is_ready();
}

bool port_fire(void)
{
    CHECK(fake.live && !fake.prepared && !fake.permitted);
    fake.live = fake.live && !fake.interrupted;
    fake.interrupted = false;
    if (!fake.live)
        return false;
    start_shot();
    fake.now_us += FIRING_US;
    return true;
}

void port_permit(void)
{
    CHECK(fake.live && !fake.prepared && !fake.permitted && !fake.edge_fired);
    fake.permitted = true;
}

struct port_edges port_take_edges(void)
{
    const struct port_edges edges = {fake.rises, fake.edge_fired};
    fake.rises = 0;
    fake.edge_fired = false;
    return edges;
}

uint32_t port_take_cameras(void)
{
    const uint32_t cameras = fake.cameras;
    fake.cameras = 0;
    return cameras;
}

uint32_t port_take_lights(void)
{
    const uint32_t lights = fake.lights | fake.stuck_lights;
    fake.lights = 0;
    return lights;
}

bool port_intact(void)
{
    return !fake.damaged;
}

bool port_read_stored(uint32_t words[STORED_WORDS])
{
    CHECK(!fake.live);
    memcpy(words, fake.stored, sizeof fake.stored);
    return fake.any_stored;
}

void port_store(const uint32_t words[STORED_WORDS])
{
    CHECK(!fake.live);
    fake.stores++;
    if (fake.store_is_full)
        return;
    memcpy(fake.stored, words, sizeof fake.stored);
    fake.any_stored = true;
    fake.stored[5] ^= fake.store_damages;
}

struct port_line_errors port_line_errors(void)
{
    return fake.line_errors;
}

bool port_clock_sound(void)
{
    return !fake.clock_wrong;
}

bool port_prepare_light(const uint32_t *current_ma)
{
    CHECK(!fake.live && !fake.permitted);
    for (int i = 0; i < CHANNEL_COUNT; i++) {
        CHECK(current_ma[i] <= MAX_LIGHT_MA);
        fake.light_ma[i] = current_ma[i];
    }
    fake.live = fake.prepared = true;
    fake.lit_until_us = 0;
    return is_ready();
}

void port_sustain_light(void)
{
    CHECK(fake.live && fake.prepared);
    fake.lit_until_us = fake.now_us + LIGHT_SUSTAIN_MS * 1000u;
    for (int i = 0; i < CHANNEL_COUNT; i++)
        fake.lights |= fake.light_ma[i] ? 1u << i : 0u;
}

void port_off(void)
{
    fake.live = fake.permitted = fake.prepared = false;
    fake.lit_until_us = 0;
}

void port_send(char byte)
{
    if (!fake.sending)
        fake.fired_before_sending = fake.fired;
    CHECK(fake.sending < sizeof fake.reply - 1);
    fake.reply[fake.sending++] = byte;
    if (byte != '\n')
        return;
    CHECK(fake.sending > 6 && fake.reply[fake.sending - 6] == '*');
    fake.reply[fake.sending] = '\0';
    fake.sending = 0;
    fake.replies++;
}

const char *exchange(struct protocol *protocol, const char *body)
{
    char line[MAX_LINE + 16];
    const unsigned replies = fake.replies;
    char marked[MAX_LINE + 8];
    snprintf(marked, sizeof marked, ">%s", body);
    snprintf(line, sizeof line, "%s*%04X\n", marked, crc16(marked, strlen(marked)));
    for (const char *byte = line; *byte; byte++)
        protocol_receive(protocol, *byte);
    CHECK(fake.replies == replies + 1);
    CHECK(fake.reply[0] == '<');
    *strrchr(fake.reply, '*') = '\0';
    return fake.reply + 1;
}
