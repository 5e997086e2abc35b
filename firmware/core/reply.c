#include "reply.h"

#include "crc16.h"
#include "generator.h"
#include "port.h"

enum { POLL_EVERY_US = 50 }; /* a byte takes 87 us on a serial line, and next to none on USB */

static void poll(struct reply *reply)
{
    const uint32_t now_us = (uint32_t)port_now_us();
    if (now_us - reply->polled_us < POLL_EVERY_US)
        return;
    reply->polled_us = now_us;
    generator_poll(reply->generator);
}

/* The one place that sends. */
static void put(struct reply *reply, char character)
{
    reply->crc = crc16_on(reply->crc, character);
    port_send(character);
    poll(reply);
}

struct reply reply_begin(struct generator *generator)
{
    return (struct reply){generator, CRC16_START, (uint32_t)port_now_us()};
}

void reply_word(struct reply *reply, const char *word)
{
    while (*word)
        put(reply, *word++);
}

void reply_number(struct reply *reply, uint32_t number)
{
    char digits[10];
    uint32_t count = 0;
    do {
        digits[count++] = (char)('0' + (int)(number % 10u));
        number /= 10u;
    } while (number);
    while (count)
        put(reply, digits[--count]);
}

void reply_fields(struct reply *reply, const char *names, const uint32_t *numbers)
{
    while (*names) {
        put(reply, ' ');
        for (; *names && *names != ' '; names++)
            put(reply, *names);
        put(reply, '=');
        reply_number(reply, *numbers++);
        names += *names == ' ';
    }
}

void reply_end(struct reply *reply)
{
    const uint16_t crc = reply->crc;
    put(reply, '*');
    for (int shift = 12; shift >= 0; shift -= 4)
        put(reply, "0123456789ABCDEF"[(crc >> shift) & 15]);
    put(reply, '\n');
}
