/* Continuous light: how little it may be, for how long, and what ends it. */
#include <string.h>

#include "fake_port.h"
#include "generator.h"
#include "light.h"
#include "safety.h"
#include "shooting.h"

static struct generator generator;

static const struct channel LEGAL = {
    .a_start_ns = 20000,
    .a_width_ns = 1000,
    .current_ma = 20000,
    .frame_a_close_ns = 22000,
};

static const uint32_t LOW_MA[CHANNEL_COUNT] = {100, 0, 0, MAX_LIGHT_MA};

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

static void boot_lit(uint32_t time_ms)
{
    boot();
    CHECK(light_start(&generator, time_ms, LOW_MA) == ERROR_NONE && generator.state == STATE_LIT && !fake_lit());
    generator_poll(&generator);
    CHECK(fake_lit());
}

static enum error light_of(uint32_t current_ma)
{
    const uint32_t currents_ma[CHANNEL_COUNT] = {[2] = current_ma};
    return light_start(&generator, 1000, currents_ma);
}

static void test_current_and_time_have_bounds(void)
{
    boot();
    CHECK(light_of(0) == ERROR_LIGHT && light_of(MAX_LIGHT_MA + 1) == ERROR_LIGHT &&
          light_of(UINT32_MAX) == ERROR_LIGHT);
    CHECK(light_start(&generator, 0, LOW_MA) == ERROR_LIGHT &&
          light_start(&generator, MAX_LIGHT_MS + 1, LOW_MA) == ERROR_LIGHT);
    CHECK(light_of(MAX_LIGHT_MA) == ERROR_NONE);
    safety_off(&generator);
    wait_us(LONGEST_PERIOD_US);
    CHECK(light_start(&generator, MAX_LIGHT_MS, LOW_MA) == ERROR_NONE);
}

static void test_the_limits_of_an_led_bind_it_too(void)
{
    boot();
    CHECK(!safety_tighten(&generator, 2, &(struct channel_limits){UINT32_MAX, UINT32_MAX, 300}) &&
          light_of(301) == ERROR_LIMIT);
    CHECK(!safety_tighten(&generator, 2, &(struct channel_limits){200, UINT32_MAX, UINT32_MAX}) &&
          light_of(201) == ERROR_LIMIT);
    CHECK(light_of(200) == ERROR_NONE);
    CHECK(safety_tighten(&generator, 2, &(struct channel_limits){1, 1, 1}) == ERROR_NOT_SAFE);
    safety_off(&generator);
    wait_us(LONGEST_PERIOD_US);
    CHECK(!safety_tighten(&generator, 2, &(struct channel_limits){200, 0, 200}) && light_of(1) == ERROR_LIMIT);
}

static void test_it_ends_by_itself_when_its_time_is_over(void)
{
    boot_lit(10);
    wait_us(9999);
    CHECK(fake_lit() && generator.state == STATE_LIT);
    wait_us(1);
    CHECK(!fake_lit() && !fake.live && generator.state == STATE_SAFE && generator.faults == 0);
}

static void test_a_processor_that_stops_asking_gets_no_more(void)
{
    boot_lit(1000);
    fake.now_us += LIGHT_SUSTAIN_MS * 1000u - 1;
    CHECK(fake_lit());
    fake.now_us++;
    CHECK(!fake_lit());
}

static void test_every_stop_ends_it(void)
{
    boot_lit(1000);
    safety_off(&generator);
    CHECK(generator.state == STATE_SAFE && !fake_lit() && !fake.live);
    boot_lit(1000);
    fake.interlock_closed = false;
    generator_poll(&generator);
    CHECK(generator.state == STATE_FAULT && generator.faults == FAULT_INTERLOCK && !fake_lit());
    boot_lit(1000);
    fake.estop_closed = false;
    generator_poll(&generator);
    CHECK(generator.state == STATE_FAULT && generator.faults == FAULT_ESTOP && !fake_lit());
    boot_lit(10000);
    fake.now_us += HEARTBEAT_MS * 1000u + 1;
    generator_poll(&generator);
    CHECK(generator.state == STATE_FAULT && generator.faults == FAULT_HEARTBEAT && !fake_lit());
}

static void test_it_needs_closed_stops_and_a_safe_generator(void)
{
    boot();
    fake.interlock_closed = false;
    CHECK(light_of(100) == ERROR_INTERLOCK_OPEN && generator.state == STATE_SAFE);
    fake.interlock_closed = true;
    fake.estop_closed = false;
    CHECK(light_of(100) == ERROR_ESTOP_OPEN && light_of(100) == ERROR_FAULT_LATCHED);
    boot_lit(1000);
    CHECK(light_of(100) == ERROR_NOT_SAFE && safety_new_train(&generator) == ERROR_NOT_SAFE);
    CHECK(shooting_arm(&generator, 1, SOURCE_COMMAND, 0) == ERROR_NOT_SAFE &&
          shooting_fire(&generator) == ERROR_NOT_ARMED);
    CHECK(safety_clear(&generator) == ERROR_NOT_SAFE && fake_lit());
}

static void load_and_arm(void)
{
    CHECK(!safety_set_channel(&generator, 0, &LEGAL) && !safety_load(&generator));
    CHECK(!shooting_arm(&generator, 2, SOURCE_COMMAND, 0));
}

static void test_it_never_meets_the_set_points_of_pulses(void)
{
    boot();
    load_and_arm();
    CHECK(light_of(100) == ERROR_NOT_SAFE);
    safety_off(&generator);
    wait_us(SETTLE_MS * 1000u - 1);
    CHECK(light_of(100) == ERROR_EARLY);
    wait_us(1);
    CHECK(light_of(100) == ERROR_NONE);
}

static void test_it_waits_anew_after_every_train(void)
{
    boot();
    for (int train = 0; train < 3; train++) {
        load_and_arm();
        safety_off(&generator);
        CHECK(light_of(100) == ERROR_EARLY);
        wait_us(SETTLE_MS * 1000u);
    }
    CHECK(light_of(100) == ERROR_NONE);
}

static void test_it_waits_for_the_period_of_the_last_shot(void)
{
    boot();
    CHECK(!safety_tighten(&generator, 0, &(struct channel_limits){UINT32_MAX, 10, UINT32_MAX}));
    load_and_arm();
    CHECK(shooting_fire(&generator) == ERROR_NONE); /* 1 us at 10 ppm: 100 ms */
    safety_off(&generator);
    wait_us(100000 - 1);
    CHECK(light_of(100) == ERROR_EARLY);
    wait_us(1);
    CHECK(light_of(100) == ERROR_NONE);
}

static void test_a_train_that_is_not_over_is_not_cut_off(void)
{
    boot();
    load_and_arm();
    generator.shots_left = 1;
    CHECK(shooting_fire(&generator) == ERROR_NONE && generator.state == STATE_SAFE && fake.live);
    generator.not_before_us = 0; /* even if the period were */
    CHECK(light_of(100) == ERROR_EARLY && fake.live);
}

static void test_a_shot_after_it_waits_as_after_a_start(void)
{
    boot_lit(1000);
    safety_off(&generator);
    load_and_arm();
    wait_us(LONGEST_PERIOD_US - 1);
    CHECK(shooting_fire(&generator) == ERROR_EARLY);
    wait_us(1);
    CHECK(shooting_fire(&generator) == ERROR_NONE);
}

static void test_set_points_that_do_not_read_as_set_stay_dark(void)
{
    boot();
    fake.can_load = false;
    CHECK(light_of(100) == ERROR_HARDWARE && generator.state == STATE_SAFE && !fake.live && !fake_lit());
}

static void test_currents_are_whole_steps_below_what_was_asked(void)
{
    boot();
    const uint32_t asked_ma[CHANNEL_COUNT] = {9, 105, 0, 500};
    const uint32_t actual_ma[CHANNEL_COUNT] = {0, 100, 0, 500};
    const uint32_t none_ma[CHANNEL_COUNT] = {9, 0, 0, 9};
    CHECK(light_start(&generator, 100, none_ma) == ERROR_LIGHT && !fake.live);
    CHECK(light_start(&generator, 100, asked_ma) == ERROR_NONE && !memcmp(fake.light_ma, actual_ma, sizeof actual_ma));
}

static void test_a_stop_that_opens_while_light_is_made_ready_trips(void)
{
    const uint32_t current_ma[CHANNEL_COUNT] = {100, 0, 0, 0};
    boot();
    fake.opens = &fake.interlock_closed;
    CHECK(light_start(&generator, 100, current_ma) == ERROR_INTERLOCK_OPEN && !fake.live);
    CHECK(generator.state == STATE_FAULT && generator.faults == FAULT_INTERLOCK);
}

int main(void)
{
    test_currents_are_whole_steps_below_what_was_asked();
    test_a_stop_that_opens_while_light_is_made_ready_trips();
    test_current_and_time_have_bounds();
    test_the_limits_of_an_led_bind_it_too();
    test_it_ends_by_itself_when_its_time_is_over();
    test_a_processor_that_stops_asking_gets_no_more();
    test_every_stop_ends_it();
    test_it_needs_closed_stops_and_a_safe_generator();
    test_it_never_meets_the_set_points_of_pulses();
    test_it_waits_anew_after_every_train();
    test_it_waits_for_the_period_of_the_last_shot();
    test_a_train_that_is_not_over_is_not_cut_off();
    test_a_shot_after_it_waits_as_after_a_start();
    test_set_points_that_do_not_read_as_set_stay_dark();
    return 0;
}
