/* Hostile bytes, half-right lines, clock jumps, edges of the trigger input and stops that open, the same ones for the
 * same seed, across the time at which 32 bits of microseconds wrap. After every step: no light without permission, and
 * counters that add up. The judge knows what was said and what the port saw; its limits are numbers of its own, also those
 * that the board has to keep over a start, whose memory may be full, or damage what is written, or be damaged.
 *
 *     fuzz SEED STEPS       deterministic; with -DFUZZ_INPUT LLVMFuzzerTestOneInput, for libFuzzer and replay */
#include <string.h>

#include "fake_port.h"

enum { WRAP_AFTER_US = 20000000 };
#define BEFORE_WRAP_US ((1ull << 32) - WRAP_AFTER_US)

static struct protocol protocol;
static uint64_t last_shot_us;
static uint64_t dark_until_us[CHANNEL_COUNT]; /* what the duty of each channel demands, reckoned without the core */
static uint64_t lit_us[CHANNEL_COUNT];        /* its newest light, and how much that was */
static uint32_t lit_ns[CHANNEL_COUNT];
struct limits_of_led {
    uint32_t current_ma;
    uint32_t duty_ppm;
    uint32_t light_ma;
};
static struct limits_of_led leds[CHANNEL_COUNT];
static struct limits_of_led kept[CHANNEL_COUNT]; /* over a start */
static enum { NONE, WHOLE, DAMAGED } memory;
static uint64_t spoken_us; /* the last command that was carried out */
static uint64_t pulses_us; /* the last time that the set-points of pulses stood */
static uint32_t budget;    /* shots that were permitted and not fired */
static unsigned answered;  /* number of the last line but ID */
static unsigned fired_before;
static unsigned sequence;
static unsigned shots;
static unsigned lights;
static unsigned judged_stores;
static bool was_lit;
static bool was_asked; /* for light, when the judge looked last: it may lapse for a while and come back */

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

/* Limits of four LEDs; now and then one of the twelve is any number. */
static void random_store(char *line, size_t size)
{
    uint32_t fields[12];
    for (uint32_t i = 0; i < 12; i += 3) {
        fields[i] = random_below(2) ? 20000 + random_below(10001) : random_below(30001);
        fields[i + 1] = random_below(8) ? 150 + random_below(51) : random_below(201);
        fields[i + 2] = random_below(501);
    }
    if (random_below(4) == 1)
        fields[random_below(12)] = random_below(2) ? random_below(UINT32_MAX) : 0;
    int length = snprintf(line, size, "STORE");
    for (int i = 0; i < 12; i++)
        length += snprintf(line + length, size - (size_t)length, " %u", fields[i]);
    fake.store_is_full = random_below(16) == 1;
    fake.store_damages = random_below(16) == 1;
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

static void start_with_kept(bool is_start)
{
    for (int i = 0; i < CHANNEL_COUNT; i++) {
        leds[i] = memory == WHOLE     ? kept[i]
                  : memory == DAMAGED ? (struct limits_of_led){0, 0, 0}
                                      : (struct limits_of_led){30000, 200, 500};
        const uint64_t demanded_us = leds[i].duty_ppm ? lit_us[i] + lit_ns[i] * 1000ull / leds[i].duty_ppm : 0;
        if (is_start || dark_until_us[i] < demanded_us) /* a start forgets which limits were tightened */
            dark_until_us[i] = demanded_us;
    }
}

/* The core has written to the memory of the board, which it may do only when it was asked to, and may be asked. */
static void judge_store(const char *command, bool accepted)
{
    static const uint32_t most[3] = {30000, 200, 500};
    uint32_t fields[12];
    const char *rest = command;
    CHECK(!strncmp(command, "STORE ", 6) && answered != sequence && fake.stores == judged_stores + 1);
    for (int i = 0; i < 12; i++) {
        rest = strchr(rest, ' ') + 1;
        fields[i] = (uint32_t)strtoul(rest, NULL, 10);
        CHECK(fields[i] <= most[i % 3]);
    }
    judged_stores = fake.stores;
    const bool is_same = memory == WHOLE && !memcmp(kept, fields, sizeof kept);
    CHECK(accepted == (fake.store_is_full ? is_same : !fake.store_damages));
    if (!fake.store_is_full) {
        memory = fake.store_damages ? DAMAGED : WHOLE;
        memcpy(kept, fields, sizeof kept);
    }
    start_with_kept(false);
}

/* What the board says that it keeps. */
static void judge_stored(const char *reply)
{
    unsigned said[5];
    const char *rest = strstr(reply, "stored=");
    CHECK(rest && sscanf(rest, "stored=%u channel=%u max_current_ma=%u max_duty_ppm=%u max_light_ma=%u", &said[0],
                         &said[1], &said[2], &said[3], &said[4]) == 5);
    static const struct limits_of_led most = {30000, 200, 500}, none;
    const struct limits_of_led *led = memory == WHOLE ? &kept[said[1]] : memory == NONE ? &most : &none;
    CHECK(said[0] == memory && said[2] == led->current_ma && said[3] == led->duty_ppm && said[4] == led->light_ma);
}

static void say(const char *command)
{
    char body[3 * MAX_LINE];
    sequence += random_below(8) != 0; /* now and then the same number again */
    snprintf(body, sizeof body, "%u %s", sequence % 65536, command);
    const char *reply = exchange(&protocol, body);
    const bool accepted = strstr(reply, " OK");
    if (fake.stores != judged_stores)
        judge_store(command, accepted);
    else
        CHECK(!accepted || strncmp(command, "STORE ", 6) || answered == sequence);
    if (accepted && !strncmp(command, "STORED ", 7) && answered != sequence)
        judge_stored(reply);
    if (accepted)
        judge_accepted(command);
}

static void random_command(void)
{
    static const char *const words[] = {"NEW", "LOAD", "FIRE", "FIRE", "FIRE", "STATUS", "BEAT", "OFF", "CLEAR", "ID"};
    char command[2 * MAX_LINE];
    const uint32_t choice = random_below(21);
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
    else if (choice == 9 && random_below(4) == 1)
        random_store(command, sizeof command);
    else if (choice <= 10)
        snprintf(command, sizeof command, "STORED %u", random_below(5));
    else
        snprintf(command, sizeof command, "%s", words[choice - 11]);
    say(command);
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
        lit_us[i] = fake.now_us;
        lit_ns[i] = channel->a_width_ns + channel->b_width_ns;
        dark_until_us[i] = fake.now_us + lit_ns[i] * 1000ull / leds[i].duty_ppm;
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
    CHECK(was_asked || pulses_us == 0 || fake.now_us - pulses_us >= 20000);
    for (int i = 0; i < CHANNEL_COUNT; i++) {
        if (!fake.light_ma[i])
            continue;
        CHECK(fake.light_ma[i] <= leds[i].light_ma && fake.light_ma[i] <= leds[i].current_ma);
        CHECK(leds[i].duty_ppm > 0 && (was_asked || fake.now_us >= dark_until_us[i]));
        lit_us[i] = fake.now_us;
        lit_ns[i] = 4000;
        dark_until_us[i] = fake.now_us + lit_ns[i] * 1000ull / leds[i].duty_ppm;
    }
}

static void forget(void)
{
    start_with_kept(true);
    budget = 0;
    answered = UINT32_MAX; /* none */
}

/* Sometimes with a bit of its memory flipped: one of those that tell. */
static void restart(void)
{
    if (random_below(4) == 1 && memory == WHOLE) {
        fake.stored[random_below(STORED_WORDS - 2)] ^= 1u << random_below(32);
        memory = DAMAGED;
    }
    protocol_boot(&protocol, protocol.boot + 1, random_below(4) ? CAUSE_POWER : CAUSE_WATCHDOG);
    fake.fired = fired_before = 0;
    forget();
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
    CHECK(memory != DAMAGED || generator->faults & FAULT_LIMITS);
    CHECK(!fake.permitted || (generator->state == STATE_ARMED && generator->source == SOURCE_EXTERNAL));
    CHECK(generator->state != STATE_LIT || (fake.live && fake.prepared));
    CHECK(fake.fired - fired_before <= 1);
    if (fake.live && !fake.prepared)
        pulses_us = fake.now_us;
    if (fake_lit())
        check_light();
    lights += fake_lit() && !was_lit;
    was_lit = fake_lit();
    was_asked = generator->state == STATE_LIT;
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
    memory = NONE;
    memset(lit_us, 0, sizeof lit_us);
    memset(lit_ns, 0, sizeof lit_ns);
    forget();
    spoken_us = pulses_us = 0;
    protocol_boot(&protocol, 1, CAUSE_POWER);
    fired_before = sequence = shots = lights = judged_stores = 0;
    was_lit = was_asked = false;
    last_shot_us = 0;
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

/* What leads to shots, without chance in between. */
static void session(void)
{
    char command[MAX_LINE];
    say("CLEAR");
    say("NEW");
    for (uint32_t count = 1 + random_below(3); count > 0; count--) {
        random_channel(command, sizeof command);
        say(command);
    }
    say("LOAD");
    check_invariants();
    random_arm(command, sizeof command);
    say(command);
}

static void step(void)
{
    const uint32_t choice = random_below(38);
    if (choice == 0)
        random_bytes();
    else if (choice == 1)
        abort_all();
    else if (choice < 8)
        let_time_pass();
    else if (choice < 12)
        trigger_edge();
    else if (choice == 12)
        session();
    else
        random_command();
    check_invariants();
    if (random_below(300) == 1) {
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
