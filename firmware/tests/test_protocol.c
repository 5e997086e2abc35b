/* Lines: framing, numbering, repetition, damage, the abort byte. */
#include <string.h>

#include "crc16.h"
#include "fake_port.h"

static struct protocol protocol;

#define CHANNEL_0 "CHANNEL 0 0 20000 1000 26400 1000 20000 22000 23000"
#define ASK(body) exchange(&protocol, body)
#define CHECK_REPLY(body, expected) CHECK(!strcmp(ASK(body), expected))

static void boot(void)
{
    fake_reset();
    protocol_boot(&protocol, 3, CAUSE_POWER);
    fake.now_us += 2 * MIN_PERIOD_US; /* the first shot after a start waits as long as the longest train demands */
}

static void boot_armed(void)
{
    boot();
    CHECK_REPLY("1 NEW", "1 3 OK");
    ASK("2 " CHANNEL_0);
    CHECK_REPLY("3 LOAD", "3 3 OK train=1 length_ns=27400 period_us=10000");
    CHECK_REPLY("4 ARM 5 0 0", "4 3 OK train=1 shots_left=5");
}

static void receive(const char *bytes)
{
    while (*bytes)
        protocol_receive(&protocol, *bytes++);
}

static void test_a_shot_from_boot_to_off(void)
{
    boot_armed();
    CHECK_REPLY("5 FIRE", "5 3 OK fired=1 train=1 shots_left=4");
    CHECK_REPLY("6 FIRE", "6 3 ERR 10");
    CHECK_REPLY("7 BEAT", "7 3 OK state=1");
    CHECK_REPLY("8 OFF", "8 3 OK state=0");
    CHECK(fake.fired == 1 && !fake.live);
}

static void test_a_repeated_line_is_answered_but_not_done_again(void)
{
    boot_armed();
    const unsigned replies = fake.replies;
    for (int i = 0; i < 3; i++) {
        CHECK_REPLY("5 FIRE", "5 3 OK fired=1 train=1 shots_left=4");
        fake.now_us += MIN_PERIOD_US;
    }
    CHECK(fake.fired == 1 && fake.replies == replies + 3);
    boot_armed();
    for (int i = 0; i < 3; i++) {
        CHECK_REPLY("0 FIRE", "0 3 OK fired=1 train=1 shots_left=4");
        fake.now_us += MIN_PERIOD_US;
    }
    CHECK(fake.fired == 1);
}

static void test_a_number_cannot_be_used_for_another_line(void)
{
    boot_armed();
    CHECK_REPLY("4 FIRE", "4 3 ERR 5");
    CHECK_REPLY("4 ARM 5 0 0", "4 3 OK train=1 shots_left=5");
    CHECK(fake.fired == 0);
}

static void test_id_is_fresh_and_leaves_the_kept_reply_alone(void)
{
    boot_armed();
    CHECK(strstr(ASK("0 ID"), "0 3 OK model=tomoshadow-pulse ") && strstr(fake.reply, " last=4"));
    CHECK(strstr(ASK("4 ID"), "4 3 OK model=") && strstr(fake.reply, " tick_ns=8 cause=1 last=4"));
    CHECK_REPLY("4 ARM 5 0 0", "4 3 OK train=1 shots_left=5");
}

static void test_malformed_lines_have_numbered_errors(void)
{
    boot();
    CHECK_REPLY("1 FLY", "1 3 ERR 3");
    CHECK_REPLY("2", "2 3 ERR 3");
    CHECK_REPLY("3 ARM", "3 3 ERR 4");
    CHECK_REPLY("4 ARM 1 2 3 4", "4 3 ERR 4");
    CHECK_REPLY("5 ARM -1 0 0", "5 3 ERR 4");
    CHECK_REPLY("6 OFF 1", "6 3 ERR 4");
    CHECK_REPLY("7 ARM 4294967296 0 0", "7 3 ERR 4");
    CHECK_REPLY("8 CHANNEL 4 0 20000 1000 26400 1000 20000 22000 23000", "8 3 ERR 12");
    CHECK_REPLY("x OFF", "? 3 ERR 4");
    CHECK_REPLY("65536 OFF", "? 3 ERR 4");
    CHECK_REPLY("", "? 3 ERR 4");
}

static void test_damaged_lines_are_answered_and_counted(void)
{
    boot_armed();
    const char *damaged[] = {">5 FIRE\n", ">5 FIRE*0000\n", ">5 FIRE*12\n", "*\n", ">5 FIRE*zzzz\n"};
    for (size_t i = 0; i < sizeof damaged / sizeof *damaged; i++) {
        receive(damaged[i]);
        CHECK(!strncmp(fake.reply, "<? 3 ERR 1*", 11));
    }
    CHECK(protocol.generator.counters.crc_errors == 5 && fake.fired == 0);
    CHECK_REPLY("5 FIRE", "5 3 OK fired=1 train=1 shots_left=4");
}

static void test_an_overlong_line_is_one_error(void)
{
    boot();
    const unsigned replies = fake.replies;
    for (int i = 0; i < 10 * MAX_LINE; i++)
        protocol_receive(&protocol, 'A');
    CHECK(fake.replies == replies);
    receive("\n");
    CHECK(fake.replies == replies + 1 && !strncmp(fake.reply, "<? 3 ERR 2*", 11));
    CHECK_REPLY("1 BEAT", "1 3 OK state=0");
}

static void test_empty_lines_and_carriage_returns_are_no_lines(void)
{
    boot();
    receive("\n\r\n\n");
    CHECK(fake.replies == 0);
}

static void test_the_abort_byte_works_inside_a_line(void)
{
    boot_armed();
    CHECK_REPLY("5 FIRE", "5 3 OK fired=1 train=1 shots_left=4");
    receive(">6 OF");
    protocol_receive(&protocol, ABORT_BYTE);
    CHECK(!fake.live && protocol.generator.state == STATE_SAFE && protocol.length == 5);
    receive("\n");
    CHECK_REPLY("7 FIRE", "7 3 ERR 7");
    boot_armed();
    for (int i = 0; i < 2 * MAX_LINE; i++)
        protocol_receive(&protocol, 'A');
    protocol_receive(&protocol, ABORT_BYTE);
    CHECK(!fake.live && protocol.generator.state == STATE_SAFE && protocol.generator.shots_left == 0);
}

static void test_a_host_that_has_gone_trips_at_once(void)
{
    boot_armed();
    receive(">6 OF");
    protocol_receive(&protocol, HANG_UP_BYTE);
    CHECK(!fake.live && protocol.generator.state == STATE_FAULT && protocol.generator.faults == FAULT_HEARTBEAT);
    CHECK(protocol.generator.shots_left == 0);
    receive("\n");
    CHECK_REPLY("7 CLEAR", "7 3 OK state=0");
    protocol_receive(&protocol, HANG_UP_BYTE);
    CHECK(!fake.live && protocol.generator.state == STATE_SAFE && protocol.generator.faults == 0);
    boot_armed();
    ASK("5 OFF");
    ASK("6 ARM 1 0 0");
    ASK("7 FIRE");
    CHECK(fake.live && protocol.generator.state == STATE_SAFE); /* the last train still runs */
    protocol_receive(&protocol, HANG_UP_BYTE);
    CHECK(!fake.live && protocol.generator.state == STATE_SAFE && protocol.generator.faults == 0);
}

static void test_damaged_lines_do_not_feed_the_heartbeat(void)
{
    boot_armed();
    fake.now_us += HEARTBEAT_MS * 1000u;
    receive("nonsense\n");
    protocol_poll(&protocol);
    CHECK(protocol.generator.state == STATE_ARMED);
    fake.now_us++;
    CHECK_REPLY("5 BEAT", "5 3 OK state=2"); /* too late: the line itself finds the fault */
    CHECK_REPLY("6 CLEAR", "6 3 OK state=0");
}

/* What is sent, word for word; the newest reply, or NULL if there is none. */
static const char *raw(const char *line)
{
    const unsigned replies = fake.replies;
    receive(line);
    return fake.replies == replies ? NULL : fake.reply;
}

static const char *with_crc(const char *body)
{
    static char line[REPLY_SIZE];
    snprintf(line, sizeof line, "%s*%04X\n", body, crc16(body, strlen(body)));
    return line;
}

static void test_a_reply_that_comes_back_is_dropped(void)
{
    boot_armed();
    CHECK(!raw("<4 3 OK train=1 shots_left=5*0000\n") && !raw(with_crc("<5 FIRE")) && !raw("<\n"));
    for (int i = 0; i < 2 * MAX_LINE; i++)
        protocol_receive(&protocol, '<');
    CHECK(!raw("\n") && protocol.generator.counters.crc_errors == 0);
    CHECK_REPLY("5 BEAT", "5 3 OK state=1");
}

/* Of a line that gives back whatever is sent, damaged or not, in this form or the older one. */
static void test_an_echo_ends_and_does_not_keep_it_armed(void)
{
    const char *first[] = {">5 BEAT*0000\n", with_crc("5 BEAT"), "noise\n"};
    for (size_t i = 0; i < sizeof first / sizeof *first; i++) {
        boot_armed();
        const char *said = raw(first[i]);
        for (int echoes = 0; said && echoes < 4; echoes++) {
            char copy[REPLY_SIZE];
            strcpy(copy, said);
            said = raw(copy);
        }
        CHECK(!said);
    }
    boot_armed();
    for (int ms = 0; ms <= HEARTBEAT_MS; ms += 100) {
        char copy[REPLY_SIZE];
        strcpy(copy, raw(with_crc("0 ID")));
        CHECK(copy[0] == '0');
        raw(copy);
        fake.now_us += 100000;
    }
    protocol_poll(&protocol);
    CHECK(protocol.generator.faults == FAULT_HEARTBEAT);
}

/* Each line is answered, and none is a sign of life. */
static void test_only_what_is_carried_out_is_a_sign_of_life(void)
{
    const char *lines[] = {"4 ARM 5 0 0", "4 FIRE", "0 ID", "%d FLY", "%d ARM", "%d LOAD", "x BEAT", "65536 BEAT"};
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++) {
        boot_armed();
        for (int ms = 0; ms < HEARTBEAT_MS; ms += 500) {
            CHECK(protocol.generator.state == STATE_ARMED);
            char body[32];
            snprintf(body, sizeof body, lines[i], 10 + ms);
            ASK(body);
            fake.now_us += 500000;
        }
        fake.now_us++;
        protocol_poll(&protocol);
        CHECK(protocol.generator.faults == FAULT_HEARTBEAT);
    }
    boot_armed();
    for (int ms = 0; ms < HEARTBEAT_MS; ms += 500) {
        for (int i = 0; i < 2 * MAX_LINE; i++)
            protocol_receive(&protocol, 'A');
        receive("\n");
        fake.now_us += 500000;
    }
    fake.now_us++;
    protocol_poll(&protocol);
    CHECK(protocol.generator.faults == FAULT_HEARTBEAT);
    boot_armed();
    for (int beat = 0; beat < 20; beat++) {
        char body[16];
        snprintf(body, sizeof body, "%d BEAT", 10 + beat);
        fake.now_us += HEARTBEAT_MS * 1000u;
        ASK(body);
        CHECK(protocol.generator.state == STATE_ARMED);
    }
}

static void test_an_older_host_learns_the_protocol_and_nothing_else(void)
{
    boot_armed();
    CHECK(!strncmp(raw(with_crc("0 ID")), "0 3 OK model=tomoshadow-pulse ", 30) && strstr(fake.reply, " protocol=4 "));
    const char *lines[] = {"5 FIRE", "0 ID 1", "x ID", "65536 ID", "ID", "5 OFF"};
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++)
        CHECK(!strncmp(raw(with_crc(lines[i])), "<? 3 ERR 4*", 11));
    CHECK(fake.fired == 0 && protocol.generator.state == STATE_ARMED);
    protocol_receive(&protocol, ABORT_BYTE);
    CHECK(protocol.generator.state == STATE_SAFE);
}

/* Reading the flash takes its time. */
static void test_stored_limits_are_not_read_while_there_can_be_light(void)
{
    boot_armed();
    CHECK_REPLY("5 STORED 0", "5 3 ERR 6");
    CHECK_REPLY("6 OFF", "6 3 OK state=0");
    fake.now_us += 100000;
    CHECK_REPLY("7 LIGHT 1000 100 0 0 0", "7 3 OK state=3");
    CHECK_REPLY("8 STORED 0", "8 3 ERR 6");
    boot();
    ASK("1 " CHANNEL_0);
    CHECK_REPLY("2 LOAD", "2 3 OK train=1 length_ns=27400 period_us=10000");
    CHECK_REPLY("3 ARM 1 0 0", "3 3 OK train=1 shots_left=1");
    CHECK_REPLY("4 FIRE", "4 3 OK fired=1 train=1 shots_left=0");
    CHECK_REPLY("5 STORED 0", "5 3 ERR 10"); /* the last train is still under way */
    fake.now_us += MIN_PERIOD_US;
    CHECK_REPLY("6 STORED 0", "6 3 OK stored=0 channel=0 max_current_ma=30000 max_duty_ppm=200 max_light_ma=500");
}

static void test_a_refused_line_is_not_done_again_either(void)
{
    boot_armed();
    ASK("5 FIRE");
    CHECK_REPLY("6 FIRE", "6 3 ERR 10");
    CHECK_REPLY("6 FIRE", "6 3 ERR 10");
    CHECK(protocol.generator.counters.requested == 2);
}

/* Sending takes time: the shot does not wait for it. */
static void test_a_command_is_carried_out_before_its_reply_is_sent(void)
{
    boot_armed();
    fake.fired_before_sending = 0;
    ASK("5 FIRE");
    CHECK(fake.fired_before_sending == 1);
}

static void test_status_tells_everything(void)
{
    boot_armed();
    ASK("5 FIRE");
    ASK("6 FIRE");
    fake.interlock_closed = false;
    fake.line_errors = (struct port_line_errors){.framing = 1, .breaks = 2, .overruns = 3, .lost = 4};
    CHECK_REPLY("7 STATUS",
                "7 3 OK state=2 faults=1 interlock=0 estop=1 source=0 shots_left=0 requested=2 fired=1 "
                "suppressed=1 early=1 cameras=1 lights=0 crc_errors=0 framing=1 breaks=2 overruns=3 lost=4");
    CHECK_REPLY("8 CLEAR", "8 3 ERR 9");
}

static void test_the_longest_lines_fit(void)
{
    boot();
    protocol.boot = protocol.generator.faults = UINT32_MAX;
    protocol.generator.counters =
        (struct counters){UINT32_MAX, UINT32_MAX, UINT32_MAX, UINT32_MAX, UINT32_MAX, UINT32_MAX, UINT32_MAX};
    ASK("65535 STATUS");
    CHECK(strlen(fake.reply) < REPLY_SIZE && strstr(fake.reply, "crc_errors=4294967295"));
    CHECK(strstr(ASK("65534 CHANNEL 4294967295 4294967295 4294967295 4294967295 4294967295 4294967295 4294967295 "
                     "4294967295 4294967295"),
                 " ERR 12"));
}

int main(void)
{
    test_a_shot_from_boot_to_off();
    test_a_repeated_line_is_answered_but_not_done_again();
    test_a_number_cannot_be_used_for_another_line();
    test_id_is_fresh_and_leaves_the_kept_reply_alone();
    test_malformed_lines_have_numbered_errors();
    test_damaged_lines_are_answered_and_counted();
    test_an_overlong_line_is_one_error();
    test_empty_lines_and_carriage_returns_are_no_lines();
    test_the_abort_byte_works_inside_a_line();
    test_a_host_that_has_gone_trips_at_once();
    test_damaged_lines_do_not_feed_the_heartbeat();
    test_a_reply_that_comes_back_is_dropped();
    test_an_echo_ends_and_does_not_keep_it_armed();
    test_only_what_is_carried_out_is_a_sign_of_life();
    test_an_older_host_learns_the_protocol_and_nothing_else();
    test_stored_limits_are_not_read_while_there_can_be_light();
    test_a_refused_line_is_not_done_again_either();
    test_a_command_is_carried_out_before_its_reply_is_sent();
    test_status_tells_everything();
    test_the_longest_lines_fit();
    return 0;
}
