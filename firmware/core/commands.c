#include "commands.h"

#include "light.h"
#include "port.h"
#include "safety.h"
#include "shooting.h"

typedef enum error (*action)(struct generator *generator, const uint32_t *fields, struct text *reply);

struct command {
    const char *word;
    uint32_t field_count;
    action run;
};

void commands_identify(struct text *reply, enum cause cause, uint32_t last_sequence)
{
    text_word(reply, " model=" MODEL " version=" VERSION " build=");
    text_word(reply, port_build);
    text_word(reply, " git=");
    text_word(reply, port_git);
    text_word(reply, " serial=");
    text_word(reply, port_serial());
    text_field(reply, "protocol", PROTOCOL_VERSION);
    text_field(reply, "channels", CHANNEL_COUNT);
    text_field(reply, "tick_ns", port_tick_ns);
    text_field(reply, "cause", (uint32_t)cause);
    text_field(reply, "last", last_sequence);
}

static void state_field(struct text *reply, const struct generator *generator)
{
    text_field(reply, "state", (uint32_t)generator->state);
}

static enum error new_train(struct generator *generator, const uint32_t *fields, struct text *reply)
{
    (void)fields;
    (void)reply;
    return safety_new_train(generator);
}

/* In units of the tick or of 1 ns; the name says which. */
static void channel_fields(struct text *reply, uint32_t number, const struct channel *channel, const char *unit,
                           uint32_t unit_ns)
{
    static const char *const names[] = {" camera", " a_start", " a_width", " b_start", " b_width"};
    const uint32_t times_ns[] = {channel->camera_ns, channel->a_start_ns, channel->a_width_ns, channel->b_start_ns,
                                 channel->b_width_ns};
    text_field(reply, "channel", number);
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        text_word(reply, names[i]);
        text_word(reply, unit);
        text_number(reply, times_ns[i] / unit_ns);
    }
    text_field(reply, "current_ma", channel->current_ma);
}

static enum error set_channel(struct generator *generator, const uint32_t *fields, struct text *reply)
{
    const struct channel requested = {
        .camera_ns = fields[1],
        .a_start_ns = fields[2],
        .a_width_ns = fields[3],
        .b_start_ns = fields[4],
        .b_width_ns = fields[5],
        .current_ma = fields[6],
        .frame_a_close_ns = fields[7],
        .frame_b_open_ns = fields[8],
    };
    const enum error error = safety_set_channel(generator, fields[0], &requested);
    if (error)
        return error;
    channel_fields(reply, fields[0], &generator->train.channels[fields[0]], "_ns=", 1);
    return ERROR_NONE;
}

static enum error limit(struct generator *generator, const uint32_t *fields, struct text *reply)
{
    const struct channel_limits asked = {fields[1], fields[2], fields[3]};
    const enum error error = safety_tighten(generator, fields[0], asked);
    if (error)
        return error;
    text_field(reply, "channel", fields[0]);
    text_field(reply, "max_current_ma", generator->limits[fields[0]].max_current_ma);
    text_field(reply, "max_duty_ppm", generator->limits[fields[0]].max_duty_ppm);
    text_field(reply, "max_light_ma", generator->limits[fields[0]].max_light_ma);
    return ERROR_NONE;
}

static enum error load(struct generator *generator, const uint32_t *fields, struct text *reply)
{
    (void)fields;
    const enum error error = safety_load(generator);
    if (error)
        return error;
    text_field(reply, "train", generator->train_id);
    text_field(reply, "length_ns", pulse_train_length_ns(&generator->train));
    text_field(reply, "period_us", channel_limits_period_us(&generator->train, generator->limits));
    return ERROR_NONE;
}

static enum error arm(struct generator *generator, const uint32_t *fields, struct text *reply)
{
    const enum error error = shooting_arm(generator, fields[0], fields[1], fields[2]);
    if (error)
        return error;
    text_field(reply, "train", generator->train_id);
    text_field(reply, "shots_left", generator->shots_left);
    return ERROR_NONE;
}

static enum error fire(struct generator *generator, const uint32_t *fields, struct text *reply)
{
    (void)fields;
    const enum error error = shooting_fire(generator);
    if (error)
        return error;
    text_field(reply, "fired", generator->counters.fired);
    text_field(reply, "train", generator->train_id);
    text_field(reply, "shots_left", generator->shots_left);
    return ERROR_NONE;
}

static enum error give_light(struct generator *generator, const uint32_t *fields, struct text *reply)
{
    const enum error error = light_start(generator, fields[0], fields + 1);
    if (error)
        return error;
    state_field(reply, generator);
    return ERROR_NONE;
}

static enum error shot(struct generator *generator, const uint32_t *fields, struct text *reply)
{
    if (fields[0] >= CHANNEL_COUNT)
        return ERROR_CHANNEL;
    const struct channel *fired = &generator->train.channels[fields[0]];
    if (!generator->fired || !fired->used)
        return ERROR_NO_SHOT;
    text_field(reply, "fired", generator->counters.fired);
    channel_fields(reply, fields[0], fired, "_ticks=", port_tick_ns);
    return ERROR_NONE;
}

static void counter_fields(struct text *reply, const struct counters *counters)
{
    static const char *const names[] = {"requested", "fired", "suppressed", "early", "cameras", "lights", "crc_errors"};
    const uint32_t counts[] = {counters->requested, counters->fired,  counters->suppressed, counters->early,
                               counters->cameras,   counters->lights, counters->crc_errors};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        text_field(reply, names[i], counts[i]);
}

static enum error status(struct generator *generator, const uint32_t *fields, struct text *reply)
{
    (void)fields;
    state_field(reply, generator);
    text_field(reply, "faults", generator->faults);
    text_field(reply, "interlock", generator->interlock_closed);
    text_field(reply, "estop", generator->estop_closed);
    text_field(reply, "source", (uint32_t)generator->source);
    text_field(reply, "shots_left", generator->shots_left);
    counter_fields(reply, &generator->counters);
    return ERROR_NONE;
}

static enum error beat(struct generator *generator, const uint32_t *fields, struct text *reply)
{
    (void)fields;
    state_field(reply, generator);
    return ERROR_NONE;
}

static enum error off(struct generator *generator, const uint32_t *fields, struct text *reply)
{
    (void)fields;
    safety_off(generator);
    state_field(reply, generator);
    return ERROR_NONE;
}

static enum error clear(struct generator *generator, const uint32_t *fields, struct text *reply)
{
    (void)fields;
    const enum error error = safety_clear(generator);
    if (error)
        return error;
    state_field(reply, generator);
    return ERROR_NONE;
}

static const struct command COMMANDS[] = {
    {"NEW", 0, new_train},    {"LIMIT", 4, limit}, {"CHANNEL", 9, set_channel},
    {"LOAD", 0, load},        {"ARM", 3, arm},     {"FIRE", 0, fire},
    {"LIGHT", 5, give_light}, {"SHOT", 1, shot},   {"STATUS", 0, status},
    {"BEAT", 0, beat},        {"OFF", 0, off},     {"CLEAR", 0, clear},
};

static const struct command *find(struct span word)
{
    for (size_t i = 0; i < sizeof COMMANDS / sizeof *COMMANDS; i++)
        if (span_equals(word, COMMANDS[i].word))
            return &COMMANDS[i];
    return NULL;
}

enum error commands_run(struct generator *generator, struct span word, struct span rest, struct text *reply)
{
    uint32_t fields[MAX_FIELDS] = {0};
    const struct command *command = find(word);
    if (!command)
        return ERROR_UNKNOWN_COMMAND;
    for (uint32_t i = 0; i < command->field_count; i++)
        if (!span_number(span_next_word(&rest), &fields[i]))
            return ERROR_SYNTAX;
    return rest.length ? ERROR_SYNTAX : command->run(generator, fields, reply);
}
