/* The firmware on a PC: the core, a pseudo-terminal as its serial line, and a laboratory around it.
 *
 *     firmware_host [--fd N]
 *
 * stdout says "port PATH" (or "port fd") first, then one line per shot:
 *     fired COUNT {CHANNEL CAMERA_NS A_START_NS A_WIDTH_NS B_START_NS B_WIDTH_NS CURRENT_MA}...
 * and for continuous light
 *     lit {CHANNEL CURRENT_MA}...      dark
 * stdin takes the lines of control.h; its end ends the program, so that it never outlives its owner. */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pty.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "bench.h"
#include "control.h"
#include "generator.h"
#include "protocol.h"

enum { RESTING_US = 10000 };

static void fail(const char *what)
{
    perror(what);
    exit(1);
}

/* The slave end stays open here too: without a reader the master would report a hang-up for ever. */
static int open_terminal(void)
{
    struct termios raw = {0};
    char path[64];
    int master = -1;
    int slave = -1;
    cfmakeraw(&raw);
    if (openpty(&master, &slave, path, &raw, NULL) < 0)
        fail("openpty");
    bench_print_event("port %s\n", path);
    return master;
}

static int open_serial(int argument_count, char **arguments)
{
    if (argument_count == 1)
        return open_terminal();
    if (argument_count != 3 || strcmp(arguments[1], "--fd")) {
        fprintf(stderr, "usage: %s [--fd N]\n", arguments[0]);
        exit(2);
    }
    bench_print_event("port fd\n");
    return atoi(arguments[2]);
}

/* False at the end of the stream. */
static bool read_serial(struct protocol *protocol)
{
    char bytes[256];
    const ssize_t count = read(bench.serial, bytes, sizeof bytes);
    for (ssize_t i = 0; i < count; i++)
        protocol_receive(protocol, bytes[i]);
    return count > 0 || (count < 0 && (errno == EAGAIN || errno == EINTR));
}

static bool read_control(struct protocol *protocol)
{
    static char line[2048];
    static size_t length;
    char byte = 0;
    if (read(STDIN_FILENO, &byte, 1) != 1)
        return false;
    if (byte != '\n') {
        if (length < sizeof line - 1)
            line[length++] = byte;
        return true;
    }
    line[length] = '\0';
    length = 0;
    control_run(protocol, line);
    return true;
}

static void run(struct protocol *protocol)
{
    struct pollfd waiting[2] = {{bench.serial, POLLIN, 0}, {STDIN_FILENO, POLLIN, 0}};
    bool open = true;
    while (open) {
        const bool armed = protocol->generator.state == STATE_ARMED;
        const uint32_t idle_us = armed ? generator_idle_us(&protocol->generator) : RESTING_US;
        ppoll(waiting, 2, &(struct timespec){.tv_nsec = (long)idle_us * 1000}, NULL);
        if (waiting[1].revents)
            open = read_control(protocol);
        if (open && waiting[0].revents)
            open = read_serial(protocol);
        protocol_poll(protocol);
    }
}

int main(int argument_count, char **arguments)
{
    static struct protocol protocol;
    bench.serial = open_serial(argument_count, arguments);
    fcntl(bench.serial, F_SETFL, fcntl(bench.serial, F_GETFL) | O_NONBLOCK);
    protocol_boot(&protocol, 1, CAUSE_POWER);
    bench_find_port();
    run(&protocol);
    return 0;
}
