#include "control.h"

#include <stdio.h>
#include <string.h>

#include "bench.h"

static void reset(struct protocol *protocol, bool watchdog)
{
    bench_power_up();
    protocol_boot(protocol, protocol->boot + 1, watchdog ? CAUSE_WATCHDOG : CAUSE_PIN);
    bench_find_port();
}

static size_t read_hex(const char *text, char *bytes, size_t size)
{
    size_t count = 0;
    unsigned byte = 0;
    while (count < size && sscanf(text + 2 * count, "%2x", &byte) == 1)
        bytes[count++] = (char)byte;
    return count;
}

static void receive_noise(struct protocol *protocol, const char *bytes, size_t count)
{
    for (size_t i = 0; i < count; i++)
        protocol_receive(protocol, bytes[i]);
}

static bool run(struct protocol *protocol, const char *line)
{
    char word[16] = "";
    char rest[1024] = "";
    char bytes[sizeof rest / 2];
    unsigned number = 0;
    sscanf(line, "%15s %1023s", word, rest);
    sscanf(rest, "%u", &number);
    if (!strcmp(word, "interlock"))
        bench_set_interlock(number != 0);
    else if (!strcmp(word, "estop"))
        bench_set_estop(number != 0);
    else if (!strcmp(word, "converter"))
        bench.converter_stuck = number == 0;
    else if (!strcmp(word, "trigger"))
        bench_trigger();
    else if (!strcmp(word, "reset"))
        reset(protocol, !strcmp(rest, "watchdog"));
    else if (!strcmp(word, "advance"))
        bench.clock_offset_us += (int64_t)number * 1000;
    else if (!strcmp(word, "garbage"))
        bench_send(bytes, read_hex(rest, bytes, sizeof bytes));
    else if (!strcmp(word, "noise"))
        receive_noise(protocol, bytes, read_hex(rest, bytes, sizeof bytes));
    else if (!strcmp(word, "lose"))
        bench.replies_to_lose = number;
    else if (!strcmp(word, "damage"))
        bench.replies_to_damage = number;
    else
        return false;
    return true;
}

void control_run(struct protocol *protocol, const char *line)
{
    const bool known = run(protocol, line);
    protocol_poll(protocol);
    bench_print_event("%s\n", known ? "done" : "unknown");
}
