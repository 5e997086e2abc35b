/* The light outputs themselves: lit when asked, and at no other time. */
#include "fake_port.h"
#include "generator.h"
#include "light.h"
#include "safety.h"
#include "shooting.h"

static struct generator generator;

static const struct channel LEGAL = {
    .a_start_ns = 20000,
    .a_width_ns = 1000,
    .b_start_ns = 26400,
    .b_width_ns = 1000,
    .current_ma = 20000,
    .frame_a_close_ns = 22000,
    .frame_b_open_ns = 23000,
};

static void wait_us(uint32_t time_us)
{
    fake.now_us += time_us;
    safety_heard(&generator);
    generator_poll(&generator);
}

static void boot(void)
{
    fake_reset();
    generator_boot(&generator, CAUSE_POWER);
    wait_us(LONGEST_PERIOD_US);
}

/* Channel 0 gives light, channel 2 triggers its camera alone. */
static void boot_armed(enum source source)
{
    boot();
    struct channel dark = LEGAL;
    dark.current_ma = 0;
    CHECK(!safety_set_channel(&generator, 0, &LEGAL) && !safety_set_channel(&generator, 2, &dark) &&
          !safety_load(&generator) && !shooting_arm(&generator, 9, source, source == SOURCE_TIMER ? MIN_PERIOD_US : 0));
    generator_poll(&generator);
}

static void check_tripped(void)
{
    CHECK(generator.state == STATE_FAULT && generator.faults == FAULT_OUTPUT && !fake.live);
}

static void test_light_without_a_shot_trips_in_every_state(void)
{
    for (int armed = 0; armed < 2; armed++) {
        boot_armed(SOURCE_COMMAND);
        if (!armed)
            safety_off(&generator);
        fake.lights = 1;
        wait_us(0);
        check_tripped();
        CHECK(safety_clear(&generator) == ERROR_NONE);
    }
}

static void test_light_on_a_channel_that_the_shot_does_not_light_trips(void)
{
    for (int channel = 1; channel < CHANNEL_COUNT; channel++) {
        boot_armed(SOURCE_COMMAND);
        CHECK(shooting_fire(&generator) == ERROR_NONE);
        fake.lights |= 1u << channel;
        wait_us(1);
        check_tripped();
    }
}

static void test_light_that_outlives_its_train_trips(void)
{
    boot_armed(SOURCE_COMMAND);
    CHECK(shooting_fire(&generator) == ERROR_NONE);
    fake.stuck_lights = 1;
    wait_us(27); /* it lasts 27.4, and is given 29 */
    CHECK(generator.state == STATE_ARMED);
    wait_us(3);
    CHECK(generator.state == STATE_ARMED);
    wait_us(1);
    check_tripped();
    CHECK(safety_clear(&generator) == ERROR_HARDWARE);
    fake.stuck_lights = 0;
    CHECK(safety_clear(&generator) == ERROR_NONE);
}

static void test_light_of_the_trigger_input_is_known_before_it_is_judged(void)
{
    boot_armed(SOURCE_EXTERNAL);
    for (int i = 0; i < 3; i++) {
        fake_edge();
        wait_us(0);
        wait_us(MIN_PERIOD_US);
        CHECK(generator.state == STATE_ARMED && generator.counters.fired == (uint32_t)i + 1);
    }
    fake_edge();
    safety_off(&generator);
    wait_us(1);
    CHECK(generator.state == STATE_SAFE && generator.faults == 0);
}

static void test_lights_count_the_channels_that_were_lit(void)
{
    boot_armed(SOURCE_TIMER);
    for (int i = 0; i < 4; i++)
        wait_us(MIN_PERIOD_US);
    wait_us(MIN_PERIOD_US / 2);
    CHECK(generator.counters.fired == 4 && generator.counters.lights == 4 && generator.counters.cameras == 8);
    safety_off(&generator);
    boot_armed(SOURCE_COMMAND);
    CHECK(shooting_fire(&generator) == ERROR_NONE);
    fake.lights = 0; /* the pin did not move */
    wait_us(MIN_PERIOD_US);
    CHECK(generator.counters.fired == 1 && generator.counters.lights == 0 && generator.state == STATE_ARMED);
}

static void test_continuous_light_is_expected_on_its_channels_until_it_ends(void)
{
    const uint32_t current_ma[CHANNEL_COUNT] = {0, 100, 0, 0};
    boot();
    CHECK(light_start(&generator, 100, current_ma) == ERROR_NONE);
    for (int i = 0; i < 3; i++)
        wait_us(1000);
    CHECK(generator.state == STATE_LIT);
    safety_off(&generator);
    wait_us(1);
    CHECK(generator.state == STATE_SAFE && generator.counters.lights == 0);
    fake.lights = 2;
    wait_us(1);
    check_tripped();
    boot();
    CHECK(light_start(&generator, 100, current_ma) == ERROR_NONE);
    wait_us(1000);
    fake.lights |= 1;
    wait_us(1);
    check_tripped();
}

static void test_the_outputs_are_looked_at_every_millisecond_while_there_can_be_light(void)
{
    boot();
    CHECK(generator_idle_us(&generator) == POLL_US);
    boot_armed(SOURCE_COMMAND);
    CHECK(generator_idle_us(&generator) < 1000);
    CHECK(shooting_fire(&generator) == ERROR_NONE && generator_idle_us(&generator) < 1000);
}

static void test_a_damaged_program_trips_and_stays(void)
{
    boot_armed(SOURCE_COMMAND);
    fake.damaged = true;
    wait_us(1);
    CHECK(generator.state == STATE_FAULT && generator.faults == FAULT_INTERNAL && !fake.live);
    CHECK(safety_clear(&generator) == ERROR_HARDWARE);
    boot();
    fake.damaged = true;
    wait_us(1);
    CHECK(generator.state == STATE_FAULT && generator.faults == FAULT_INTERNAL);
}

int main(void)
{
    test_light_without_a_shot_trips_in_every_state();
    test_light_on_a_channel_that_the_shot_does_not_light_trips();
    test_light_that_outlives_its_train_trips();
    test_light_of_the_trigger_input_is_known_before_it_is_judged();
    test_lights_count_the_channels_that_were_lit();
    test_continuous_light_is_expected_on_its_channels_until_it_ends();
    test_the_outputs_are_looked_at_every_millisecond_while_there_can_be_light();
    test_a_damaged_program_trips_and_stays();
    return 0;
}
