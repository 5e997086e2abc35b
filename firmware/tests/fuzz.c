/* Hostile bytes, half-right lines, clock jumps, edges of the trigger input and stops that open, the same ones for the
 * same seed, across the time at which 32 bits of microseconds wrap. After every step: no light without permission, and
 * counters that add up. The judge knows what was said and what the port saw; its limits are numbers of its own.
 *
 *     fuzz SEED STEPS       deterministic; with -DFUZZ_INPUT LLVMFuzzerTestOneInput, for libFuzzer and replay */
#include <string.h>

#include "fake_port.h"

enum { WRAP_AFTER_US = 20000000 };
#define BEFORE_WRAP_US ((1ull << 32) - WRAP_AFTER_US)

static struct protocol protocol;
static uint64_t last_shot_us;
static uint64_t dark_until_us[CHANNEL_COUNT]; /* what the duty of each channel demands, reckoned without the core */
static struct limits_of_led {
    uint32_t current_ma;
    uint32_t duty_ppm;
    uint32_t light_ma;
} leds[CHANNEL_COUNT];
static uint64_t spoken_us; /* the last command that was carried out */
static uint64_t pulses_us; /* the last time that the set-points of pulses stood */
static uint32_t budget;    /* shots that were permitted and not fired */
static unsigned answered;  /* number of the last line but ID */
static unsigned fired_before;
static unsigned sequence;
static unsigned shots;
static unsigned lights;
static bool was_lit;

#ifdef FUZZ_INPUT
static const uint8_t *input; /* decides instead of chance, until it is used up */
static size_t input_left;

static uint32_t random_below(uint32_t bound)
{
    uint32_t number = 0;
    for (uint32_t range = bound - 1; range > 0 && input_left > 0; range >>= 8) {
        number = number << 8 | *input++;
        input_left--;
    }
    return number % bound;
}
#else
static uint64_t random_state;

static uint32_t random_below(uint32_t bound)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return (uint32_t)((random_state >> 32) % bound);
}
#endif

static void random_bytes(void)
{
    for (uint32_t count = random_below(200); count > 0; count--)
        protocol_receive(&protocol, (char)random_below(256));
    protocol_receive(&protocol, '\n');
}

static void random_channel(char *line, size_t size)
{
    const uint32_t jitter = random_below(4) ? random_below(3) : random_below(UINT32_MAX);
    const bool single = random_below(8) == 1;
    snprintf(line, size, "CHANNEL %u %u %u %u %u %u %u %u %u", random_below(5), random_below(2000), 20000 + jitter,
             200 + random_below(1900), single ? 0u : 26400 + random_below(300), single ? 0u : 200 + random_below(1900),
             random_below(31000), 22100 + random_below(100), 23000 + random_below(3500));
}

static void random_arm(char *line, size_t size)
{
    snprintf(line, size, "ARM %u %u %u", random_below(20), random_below(4), random_below(3) ? 0u : random_below(50000));
}

static void random_limit(char *line, size_t size)
{
    snprintf(line, size, "LIMIT %u %u %u %u", random_below(5), 25000 + random_below(10000), random_below(500),
             200 + random_below(1000));
}

static void random_light(char *line, size_t size)
{
    snprintf(line, size, "LIGHT %u %u %u %u %u", random_below(3000), random_below(520), random_below(2) * 400,
             random_below(520), random_below(3) * 100);
}

static uint32_t smaller(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

/* A command was answered by OK: for the first time, unless its number is that of the one before. */
static void judge_accepted(const char *command)
{
    unsigned channel = 0;
    struct limits_of_led led = {0, 0, 0};
    if (!strcmp(command, "ID") || answered == sequence)
        return;
    answered = sequence;
    spoken_us = fake.now_us;
    sscanf(command, "ARM %u", &budget);
    if (!strcmp(command, "OFF"))
        budget = 0;
    if (sscanf(command, "LIMIT %u %u %u %u", &channel, &led.current_ma, &led.duty_ppm, &led.light_ma) == 4) {
        leds[channel].current_ma = smaller(leds[channel].current_ma, led.current_ma);
        leds[channel].duty_ppm = smaller(leds[channel].duty_ppm, led.duty_ppm);
        leds[channel].light_ma = smaller(leds[channel].light_ma, led.light_ma);
    }
}

static void random_command(void)
{
    static const char *const words[] = {"NEW", "LOAD", "FIRE", "FIRE", "FIRE", "STATUS", "BEAT", "OFF", "CLEAR", "ID"};
    char command[MAX_LINE];
    char body[2 * MAX_LINE];
    const uint32_t choice = random_below(19);
    if (choice < 4)
        random_channel(command, sizeof command);
    else if (choice < 6)
        random_arm(command, sizeof command);
    else if (choice == 6)
        random_limit(command, sizeof command);
    else if (choice == 7)
        random_light(command, sizeof command);
    else if (choice == 8)
        snprintf(command, sizeof command, "SHOT %u", random_below(5));
    else
        snprintf(command, sizeof command, "%s", words[choice - 9]);
    sequence += random_below(8) != 0; /* now and then the same number again */
    snprintf(body, sizeof body, "%u %s", sequence % 65536, command);
    const char *reply = exchange(&protocol, body);
    if (strstr(reply, " OK"))
        judge_accepted(command);
}

static void let_time_pass(void)
{
    fake.now_us += random_below(30000);
    if (random_below(50) == 0)
        fake.now_us += random_below(4000000);
}

/* A shot of L ns of light at a duty of D permits the next light of its channel L / D later. */
static void check_duty(void)
{
    for (int i = 0; i < CHANNEL_COUNT; i++) {
        const struct channel *channel = &fake.loaded.channels[i];
        if (!channel->used || !channel->current_ma)
            continue;
        CHECK(fake.now_us >= dark_until_us[i] && channel->current_ma <= leds[i].current_ma);
        CHECK(channel->current_ma % 10 == 0 && leds[i].duty_ppm > 0);
        const uint64_t lit_ns = (uint64_t)channel->a_width_ns + channel->b_width_ns;
        dark_until_us[i] = fake.now_us + lit_ns * 1000 / leds[i].duty_ppm;
    }
}

static void check_pulses(const struct channel *channel)
{
    const uint32_t a_end_ns = channel->a_start_ns + channel->a_width_ns;
    CHECK(channel->a_width_ns >= 200 && channel->a_width_ns <= 2000 && channel->a_start_ns <= 20000000);
    CHECK(channel->a_start_ns % 8 == 0 && channel->a_width_ns % 8 == 0 && channel->camera_ns % 8 == 0);
    CHECK(a_end_ns <= channel->camera_ns + channel->frame_a_close_ns);
    if (!channel->b_width_ns)
        return;
    CHECK(channel->b_width_ns >= 200 && channel->b_width_ns <= 2000 && channel->b_start_ns <= 20000000);
    CHECK(channel->b_start_ns >= a_end_ns + 400 && channel->b_start_ns - channel->a_start_ns <= 200000);
    CHECK(channel->b_start_ns % 8 == 0 && channel->b_width_ns % 8 == 0);
    CHECK(channel->b_start_ns >= channel->camera_ns + channel->frame_b_open_ns);
}

static void check_shot(void)
{
    CHECK(fake.interlock_closed && fake.estop_closed);
    CHECK(last_shot_us == 0 || fake.now_us - last_shot_us >= 10000);
    CHECK(fake.now_us - spoken_us <= 3000000 + FIRING_US && budget-- > 0);
    for (int i = 0; i < CHANNEL_COUNT; i++)
        if (fake.loaded.channels[i].used)
            check_pulses(&fake.loaded.channels[i]);
    check_duty();
}

/* Continuous light makes its channels wait like the train with most light. */
static void check_light(void)
{
    CHECK(protocol.generator.state == STATE_LIT && fake.prepared);
    CHECK(fake.interlock_closed && fake.estop_closed && fake.now_us - spoken_us <= 3000000);
    CHECK(was_lit || pulses_us == 0 || fake.now_us - pulses_us >= 20000);
    for (int i = 0; i < CHANNEL_COUNT; i++) {
        if (!fake.light_ma[i])
            continue;
        CHECK(fake.light_ma[i] <= leds[i].light_ma && fake.light_ma[i] <= leds[i].current_ma);
        CHECK(leds[i].duty_ppm > 0 && (was_lit || fake.now_us >= dark_until_us[i]));
        dark_until_us[i] = fake.now_us + 20000;
    }
}

static void forget_limits(void)
{
    for (int i = 0; i < CHANNEL_COUNT; i++)
        leds[i] = (struct limits_of_led){30000, 200, 500};
    budget = 0;
    answered = UINT32_MAX; /* none */
}

static void restart(void)
{
    protocol_boot(&protocol, protocol.boot + 1, CAUSE_POWER);
    fake.fired = fired_before = 0;
    for (int i = 0; i < CHANNEL_COUNT; i++) /* limits that were tightened are forgotten, the absolute ones are not */
        if (dark_until_us[i] > fake.now_us + 20000)
            dark_until_us[i] = fake.now_us + 20000;
    forget_limits();
    CHECK(!fake.live);
}

static void check_invariants(void)
{
    const struct generator *generator = &protocol.generator;
    const struct counters *counters = &generator->counters;
    CHECK(counters->requested == counters->fired + counters->suppressed && counters->fired == fake.fired);
    CHECK((generator->state == STATE_FAULT) == (generator->faults != 0));
    CHECK(generator->state != STATE_ARMED ||
          (fake.live && generator->shots_left > 0 && !pulse_train_check(&generator->train)));
    CHECK(generator->state != STATE_FAULT || !fake.live);
    CHECK(!fake.permitted || (generator->state == STATE_ARMED && generator->source == SOURCE_EXTERNAL));
    CHECK(generator->state != STATE_LIT || (fake.live && fake.prepared));
    CHECK(fake.fired - fired_before <= 1);
    if (fake.live && !fake.prepared)
        pulses_us = fake.now_us;
    if (fake_lit())
        check_light();
    lights += fake_lit() && !was_lit;
    was_lit = fake_lit();
    if (fake.fired != fired_before) {
        check_shot();
        last_shot_us = fake.now_us;
        fired_before = fake.fired;
    }
}

static void begin(void)
{
    fake_reset();
    fake.now_us = BEFORE_WRAP_US;
    forget_limits();
    spoken_us = pulses_us = 0;
    protocol_boot(&protocol, 1, CAUSE_POWER);
    fired_before = sequence = shots = lights = 0;
    was_lit = false;
    last_shot_us = 0;
    memset(dark_until_us, 0, sizeof dark_until_us);
}

/* The port's interrupt is quicker than the core. */
static bool random_stop(bool closed)
{
    const bool stays = closed ? random_below(100) != 1 : random_below(3) == 0;
    if (closed && !stays) {
        port_off();
        budget = 0;
    }
    return stays;
}

static void abort_all(void)
{
    protocol_receive(&protocol, random_below(4) ? ABORT_BYTE : HANG_UP_BYTE);
    budget = 0;
}

static void trigger_edge(void)
{
    fake_edge();
    protocol_poll(&protocol); /* counts it */
}

static void step(void)
{
    const uint32_t choice = random_below(36);
    if (choice == 0)
        random_bytes();
    else if (choice == 1)
        abort_all();
    else if (choice < 8)
        let_time_pass();
    else if (choice < 12)
        trigger_edge();
    else
        random_command();
    check_invariants();
    if (random_below(3000) == 1) {
        shots += fake.fired;
        restart();
    }
    fake.can_load = random_below(50) != 1;
    fake.interlock_closed = random_stop(fake.interlock_closed);
    fake.estop_closed = random_below(3) ? fake.estop_closed : random_stop(fake.estop_closed);
    protocol_poll(&protocol);
    check_invariants();
}

#ifdef FUZZ_INPUT
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    begin();
    input = data;
    input_left = size;
    while (input_left > 0)
        step();
    return 0;
}
#else
int main(int argument_count, char **arguments)
{
    CHECK(argument_count == 3);
    random_state = strtoull(arguments[1], NULL, 10) * 2654435761u + 1;
    begin();
    for (unsigned long left = strtoul(arguments[2], NULL, 10); left > 0; left--)
        step();
    shots += fake.fired;
    printf("%u shots, %u lights, %u starts\n", shots, lights, protocol.boot);
    return shots < 10 || lights < 10;
}
#endif
