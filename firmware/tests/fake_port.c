#include "fake_port.h"

#include <string.h>

#include "crc16.h"

struct fake_port fake;

const char port_build[] = "test";
const char port_serial[] = "0";
const uint32_t port_tick_ns = 8;

void fake_reset(void)
{
    fake = (struct fake_port){.interlock_closed = true, .can_load = true};
}

uint64_t port_now_us(void)
{
    return fake.now_us;
}

bool port_interlock_closed(void)
{
    return fake.interlock_closed;
}

bool port_load(const struct pulse_train *train)
{
    CHECK(train_check(train) == ERROR_NONE);
    fake.loaded = *train;
    fake.live = true; /* also where only a part could be loaded */
    return fake.can_load;
}

void port_fire(void)
{
    CHECK(fake.live);
    fake.fired++;
    fake.now_us += FIRING_US;
}

void port_off(void)
{
    fake.live = false;
}

void port_send(const char *bytes, size_t length)
{
    CHECK(length > 6 && length < TEXT_SIZE && bytes[length - 1] == '\n' && bytes[length - 6] == '*');
    memcpy(fake.reply, bytes, length);
    fake.reply[length] = '\0';
    fake.replies++;
}

const char *exchange(struct protocol *protocol, const char *body)
{
    char line[MAX_LINE + 16];
    const unsigned replies = fake.replies;
    snprintf(line, sizeof line, "%s*%04X\n", body, crc16(body, strlen(body)));
    for (const char *byte = line; *byte; byte++)
        protocol_receive(protocol, *byte);
    CHECK(fake.replies == replies + 1);
    *strrchr(fake.reply, '*') = '\0';
    return fake.reply;
}
