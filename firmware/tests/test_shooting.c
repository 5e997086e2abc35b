/* Who may start a shot, when, and how honestly it is counted. */
#include "fake_port.h"
#include "generator.h"
#include "safety.h"
#include "shooting.h"

enum { PERIOD_US = 100000 };

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

static void boot_loaded(void)
{
    fake_reset();
    generator_boot(&generator, CAUSE_POWER);
    CHECK(!safety_set_channel(&generator, 0, &LEGAL) && !safety_set_channel(&generator, 2, &LEGAL) &&
          !safety_load(&generator));
}

static void boot_armed(uint32_t shots, enum source source, uint32_t period_us)
{
    boot_loaded();
    wait_us(LONGEST_PERIOD_US);
    CHECK(shooting_arm(&generator, shots, source, period_us) == ERROR_NONE);
    generator_poll(&generator);
}

static void check_counters(uint32_t fired, uint32_t suppressed, uint32_t early)
{
    const struct counters *counters = &generator.counters;
    CHECK(counters->fired == fired && counters->suppressed == suppressed && counters->early == early);
    CHECK(counters->requested == fired + suppressed && fake.fired == fired);
}

static void test_sources_and_periods_have_bounds(void)
{
    boot_loaded();
    wait_us(LONGEST_PERIOD_US);
    CHECK(shooting_arm(&generator, 1, SOURCE_TIMER + 1, 0) == ERROR_SOURCE);
    CHECK(shooting_arm(&generator, 1, UINT32_MAX, 0) == ERROR_SOURCE &&
          shooting_arm(&generator, 1, SOURCE_TIMER, 0) == ERROR_PERIOD);
    for (uint32_t source = SOURCE_COMMAND; source <= SOURCE_TIMER; source++) {
        CHECK(shooting_arm(&generator, 1, source, MIN_PERIOD_US - 1) == ERROR_PERIOD);
        CHECK(shooting_arm(&generator, 1, source, MAX_PERIOD_US + 1) == ERROR_PERIOD && generator.state == STATE_SAFE);
        CHECK(shooting_arm(&generator, 1, source, MIN_PERIOD_US) == ERROR_NONE);
        safety_off(&generator);
        CHECK(shooting_arm(&generator, 1, source, MAX_PERIOD_US) == ERROR_NONE);
        safety_off(&generator);
    }
}

static void test_a_period_that_the_duty_forbids_is_refused_when_arming(void)
{
    boot_loaded();
    CHECK(!safety_tighten(&generator, 2, &(struct channel_limits){UINT32_MAX, 20, UINT32_MAX}) &&
          !safety_load(&generator));
    CHECK(shooting_arm(&generator, 1, SOURCE_COMMAND, 100000 - 1) == ERROR_PERIOD);
    CHECK(shooting_arm(&generator, 1, SOURCE_COMMAND, 100000) == ERROR_NONE);
}

static void test_only_its_source_starts_a_shot(void)
{
    boot_armed(5, SOURCE_TIMER, PERIOD_US);
    CHECK(shooting_fire(&generator) == ERROR_OTHER_SOURCE);
    fake_edge();
    wait_us(1);
    check_counters(0, 1, 0);
    boot_armed(5, SOURCE_COMMAND, 0);
    fake_edge();
    wait_us(PERIOD_US);
    check_counters(0, 0, 0);
}

static void test_an_edge_starts_exactly_one_shot(void)
{
    boot_armed(2, SOURCE_EXTERNAL, 0);
    CHECK(fake.permitted && shooting_fire(&generator) == ERROR_OTHER_SOURCE);
    fake_edge();
    fake_edge();
    wait_us(0);
    check_counters(1, 2, 1);
    CHECK(generator.shots_left == 1 && !fake.permitted);
}

static void test_an_early_edge_is_counted_and_never_queued(void)
{
    boot_armed(3, SOURCE_EXTERNAL, 0);
    fake_edge();
    wait_us(0);
    wait_us(MIN_PERIOD_US - 1);
    fake_edge();
    CHECK(!fake.permitted);
    wait_us(1);
    CHECK(fake.permitted && fake.fired == 1);
    wait_us(PERIOD_US);
    check_counters(1, 1, 1);
    fake_edge();
    wait_us(0);
    check_counters(2, 1, 1);
}

static void test_the_budget_binds_the_trigger_input(void)
{
    boot_armed(2, SOURCE_EXTERNAL, 0);
    for (int i = 0; i < 10; i++) {
        fake_edge();
        wait_us(0);
        wait_us(MIN_PERIOD_US);
    }
    CHECK(fake.fired == 2 && generator.state == STATE_SAFE && !fake.live && !fake.permitted);
}

static void test_a_late_processor_gives_the_full_period(void)
{
    boot_armed(3, SOURCE_EXTERNAL, 0);
    fake_edge();
    wait_us(5000); /* it learns of the shot only now */
    wait_us(MIN_PERIOD_US - 1);
    CHECK(!fake.permitted);
    wait_us(1);
    CHECK(fake.permitted);
}

static void test_whatever_disarms_takes_the_permission_away(void)
{
    for (int what = 0; what < 5; what++) {
        boot_armed(3, SOURCE_EXTERNAL, 0);
        if (what == 0)
            safety_off(&generator);
        else if (what == 1)
            fake.interlock_closed = false;
        else if (what == 2)
            fake.estop_closed = false;
        else if (what == 3)
            fake.now_us += HEARTBEAT_MS * 1000u + 1;
        else
            generator.train.channels[0].a_width_ns = 1u << 20;
        if (what == 4) { /* found when the next permission is asked for */
            fake_edge();
            generator_poll(&generator);
            fake.now_us += MIN_PERIOD_US;
        }
        generator_poll(&generator);
        const unsigned fired = fake.fired;
        CHECK(generator.state != STATE_ARMED && !fake.permitted && !fake.live);
        fake_edge();
        generator_poll(&generator);
        CHECK(fake.fired == fired);
    }
}

static void test_an_edge_is_permitted_anew_after_an_off(void)
{
    boot_armed(3, SOURCE_EXTERNAL, 0);
    safety_off(&generator);
    CHECK(shooting_arm(&generator, 3, SOURCE_EXTERNAL, 0) == ERROR_NONE);
    wait_us(PERIOD_US);
    CHECK(fake.permitted);
    fake_edge();
    wait_us(0);
    check_counters(1, 0, 0);
}

static void test_a_shot_that_started_before_an_off_counts(void)
{
    boot_armed(3, SOURCE_EXTERNAL, 0);
    fake_edge();
    safety_off(&generator);
    check_counters(1, 0, 0);
    CHECK(shooting_arm(&generator, 1, SOURCE_COMMAND, 0) == ERROR_NONE && shooting_fire(&generator) == ERROR_EARLY);
}

static void test_edges_count_from_arming_on(void)
{
    boot_loaded();
    wait_us(LONGEST_PERIOD_US);
    fake_edge();
    CHECK(!shooting_arm(&generator, 1, SOURCE_EXTERNAL, 0));
    wait_us(0);
    check_counters(0, 0, 0);
}

static void test_the_timer_fires_every_period_and_stops_by_itself(void)
{
    boot_armed(3, SOURCE_TIMER, PERIOD_US);
    for (uint32_t shot = 0; shot < 3; shot++) {
        wait_us(PERIOD_US - FIRING_US * (shot > 0) - 1);
        CHECK(fake.fired == shot);
        wait_us(1);
        CHECK(fake.fired == shot + 1);
    }
    wait_us(10 * PERIOD_US);
    check_counters(3, 0, 0);
    CHECK(generator.state == STATE_SAFE && !fake.live);
}

static void test_the_timer_never_catches_up(void)
{
    boot_armed(10, SOURCE_TIMER, PERIOD_US);
    wait_us(5 * PERIOD_US); /* the processor was busy */
    CHECK(fake.fired == 1);
    for (uint32_t waited_us = 1000; waited_us < PERIOD_US - 2 * FIRING_US; waited_us += 1000) {
        wait_us(1000);
        CHECK(fake.fired == 1);
    }
    wait_us(1000);
    CHECK(fake.fired == 2);
}

static void test_the_timer_keeps_the_shortest_period(void)
{
    boot_armed(10, SOURCE_TIMER, MIN_PERIOD_US);
    uint64_t shot_us = 0;
    for (int i = 0; i < 100000; i++) {
        const unsigned fired = fake.fired;
        wait_us(37);
        if (fake.fired == fired)
            continue;
        CHECK(shot_us == 0 || fake.now_us - shot_us >= MIN_PERIOD_US);
        shot_us = fake.now_us;
    }
    check_counters(10, 0, 0);
}

static void test_a_timer_armed_after_a_start_waits_for_both(void)
{
    boot_loaded();
    CHECK(!shooting_arm(&generator, 1, SOURCE_TIMER, MIN_PERIOD_US));
    wait_us(LONGEST_PERIOD_US - 1);
    check_counters(0, 0, 0);
    wait_us(1);
    check_counters(1, 0, 0);
}

static void test_a_timed_shot_that_is_refused_is_counted(void)
{
    boot_armed(10, SOURCE_TIMER, PERIOD_US);
    fake.interrupted = true;
    wait_us(PERIOD_US);
    check_counters(0, 1, 0);
    CHECK(generator.state == STATE_SAFE);
}

static void test_a_shot_that_could_not_start_is_not_counted_as_fired(void)
{
    boot_armed(2, SOURCE_COMMAND, 0);
    fake.interrupted = true; /* by the abort byte, which the core has not seen yet */
    CHECK(shooting_fire(&generator) == ERROR_NOT_ARMED && generator.state == STATE_SAFE);
    check_counters(0, 1, 0);
    CHECK(generator.counters.cameras == 0);
}

static void test_cameras_count_their_triggers(void)
{
    boot_armed(2, SOURCE_COMMAND, 0);
    CHECK(shooting_fire(&generator) == ERROR_NONE);
    wait_us(MIN_PERIOD_US);
    CHECK(generator.counters.cameras == 2);
}

static void test_the_core_says_when_it_wants_to_be_polled(void)
{
    boot_armed(2, SOURCE_COMMAND, 0);
    CHECK(generator_idle_us(&generator) == LIVE_POLL_US);
    boot_armed(2, SOURCE_TIMER, PERIOD_US);
    CHECK(generator_idle_us(&generator) == LIVE_POLL_US);
    fake.now_us += PERIOD_US - 7;
    CHECK(generator_idle_us(&generator) == 7);
    fake.now_us += 8;
    CHECK(generator_idle_us(&generator) == 0);
    boot_armed(2, SOURCE_EXTERNAL, 0);
    CHECK(generator_idle_us(&generator) == LIVE_POLL_US);
    fake_edge();
    wait_us(0);
    fake.now_us += MIN_PERIOD_US - 3;
    CHECK(generator_idle_us(&generator) == 3);
}

int main(void)
{
    test_sources_and_periods_have_bounds();
    test_a_period_that_the_duty_forbids_is_refused_when_arming();
    test_only_its_source_starts_a_shot();
    test_an_edge_starts_exactly_one_shot();
    test_an_early_edge_is_counted_and_never_queued();
    test_the_budget_binds_the_trigger_input();
    test_a_late_processor_gives_the_full_period();
    test_whatever_disarms_takes_the_permission_away();
    test_an_edge_is_permitted_anew_after_an_off();
    test_a_shot_that_started_before_an_off_counts();
    test_edges_count_from_arming_on();
    test_the_timer_fires_every_period_and_stops_by_itself();
    test_the_timer_never_catches_up();
    test_the_timer_keeps_the_shortest_period();
    test_a_timer_armed_after_a_start_waits_for_both();
    test_a_timed_shot_that_is_refused_is_counted();
    test_a_shot_that_could_not_start_is_not_counted_as_fired();
    test_cameras_count_their_triggers();
    test_the_core_says_when_it_wants_to_be_polled();
    return 0;
}
