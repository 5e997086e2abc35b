/* Runs the golden vectors of stdin through the core, byte for byte. golden_vectors.txt tells the format at its top. */
#include <string.h>

#include "fake_port.h"

static struct protocol protocol;
static unsigned checked;

static void receive_line(const char *line)
{
    while (*line)
        protocol_receive(&protocol, *line++);
}

static void fail(const char *what, const char *line)
{
    fprintf(stderr, "%s: %s", what, line);
    exit(1);
}

static void change_world(const char *what)
{
    unsigned number = 0;
    if (sscanf(what, "advance_us %u", &number) == 1)
        fake.now_us += number;
    else if (sscanf(what, "interlock %u", &number) == 1)
        fake.interlock_closed = number != 0;
    else if (sscanf(what, "estop %u", &number) == 1)
        fake.estop_closed = number != 0;
    else if (sscanf(what, "converter %u", &number) == 1)
        fake.set_points_stuck = number == 0;
    else if (!strcmp(what, "edge\n"))
        fake_edge();
    else if (!strcmp(what, "abort\n"))
        protocol_receive(&protocol, ABORT_BYTE);
    else if (!strcmp(what, "reset\n"))
        protocol_boot(&protocol, protocol.boot + 1, CAUSE_POWER);
    else
        fail("unknown change", what);
    protocol_poll(&protocol);
}

static void check_reply(const char *expected)
{
    if (strcmp(fake.reply, expected)) {
        fprintf(stderr, "expected %sreceived %s", expected, fake.reply);
        exit(1);
    }
    checked++;
}

int main(void)
{
    char line[512];
    fake_reset();
    protocol_boot(&protocol, 1, CAUSE_POWER);
    while (fgets(line, sizeof line, stdin)) {
        if (line[0] == '>')
            receive_line(line + 2);
        else if (line[0] == '<')
            check_reply(line + 2);
        else if (line[0] == '!')
            change_world(line + 2);
    }
    printf("%u\n", checked);
    return 0;
}
