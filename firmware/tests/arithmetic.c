/* The arithmetic of pulse_train.c and channel_limits.c without anything around it, for an oracle to check.
 *
 * A line of stdin is the eight fields of a channel and three limits; of stdout:
 *     ERROR                                                  of the requested values, or then
 *     ERROR CAMERA A_START A_WIDTH B_START B_WIDTH           of the quantised ones, or then
 *     0 ... WITHIN LIGHT_WITHIN LENGTH_NS PERIOD_US          with the tightened limits; also as a current of light */
#include <inttypes.h>
#include <stdio.h>

#include "channel_limits.h"

enum { TICK_NS = 8 };

static void report_train(struct channel actual, struct channel_limits asked)
{
    struct channel_limits limits = channel_limits_absolute();
    channel_limits_tighten(&limits, &asked);
    struct pulse_train train = {0};
    actual.used = true;
    train.channels[1] = actual;
    struct channel_limits all[CHANNEL_COUNT];
    for (int i = 0; i < CHANNEL_COUNT; i++)
        all[i] = limits;
    const bool within = channel_limits_allow_train(&train, all);
    printf(" %d %d %" PRIu32, within, channel_limits_allow_light(actual.current_ma, &limits),
           pulse_train_length_ns(&train));
    if (within)
        printf(" %" PRIu32, channel_limits_period_us(&train, all));
}

static void report(const struct channel *requested, struct channel_limits asked)
{
    enum error error = pulse_train_check_channel(requested);
    if (error) {
        printf("%d\n", (int)error);
        return;
    }
    const struct channel actual = pulse_train_quantised(requested, TICK_NS, 10);
    error = pulse_train_check_channel(&actual);
    printf("%d %" PRIu32 " %" PRIu32 " %" PRIu32 " %" PRIu32 " %" PRIu32, (int)error, actual.camera_ns,
           actual.a_start_ns, actual.a_width_ns, actual.b_start_ns, actual.b_width_ns);
    if (!error)
        report_train(actual, asked);
    printf("\n");
}

int main(void)
{
    struct channel channel = {0};
    struct channel_limits asked = {0};
    while (scanf("%" SCNu32 "%" SCNu32 "%" SCNu32 "%" SCNu32 "%" SCNu32 "%" SCNu32 "%" SCNu32 "%" SCNu32 "%" SCNu32
                 "%" SCNu32 "%" SCNu32,
                 &channel.camera_ns, &channel.a_start_ns, &channel.a_width_ns, &channel.b_start_ns, &channel.b_width_ns,
                 &channel.current_ma, &channel.frame_a_close_ns, &channel.frame_b_open_ns, &asked.max_current_ma,
                 &asked.max_duty_ppm, &asked.max_light_ma) == 11)
        report(&channel, asked);
    return 0;
}
