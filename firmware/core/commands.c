#include "commands.h"

#include "light.h"
#include "port.h"
#include "safety.h"
#include "shooting.h"

/* Carries a command out and notes the values of its reply. */
typedef enum error (*action)(struct generator *generator, const uint32_t *fields, uint32_t *values);

struct command {
    const char *word;
    uint32_t field_count;
    action run;
    const char *names; /* of the values of its reply */
};

void commands_identify(struct reply *reply, enum cause cause, uint32_t last_sequence)
{
    reply_word(reply, " model=" MODEL " version=" VERSION " build=");
    reply_word(reply, port_build);
    reply_word(reply, " git=");
    reply_word(reply, port_git);
    reply_word(reply, " serial=");
    reply_word(reply, port_serial());
    const uint32_t values[] = {PROTOCOL_VERSION, CHANNEL_COUNT, port_tick_ns, (uint32_t)cause, last_sequence};
    reply_fields(reply, "protocol channels tick_ns cause last", values);
}

static enum error new_train(struct generator *generator, const uint32_t *fields, uint32_t *values)
{
    (void)fields;
    (void)values;
    return safety_new_train(generator);
}

/* In units of the tick or of 1 ns. */
static void note_channel(uint32_t *values, uint32_t number, const struct channel *channel, uint32_t unit_ns)
{
    values[0] = number;
    values[1] = channel->camera_ns / unit_ns;
    values[2] = channel->a_start_ns / unit_ns;
    values[3] = channel->a_width_ns / unit_ns;
    values[4] = channel->b_start_ns / unit_ns;
    values[5] = channel->b_width_ns / unit_ns;
    values[6] = channel->current_ma;
}

static enum error set_channel(struct generator *generator, const uint32_t *fields, uint32_t *values)
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
    if (!error)
        note_channel(values, fields[0], &generator->train.channels[fields[0]], 1);
    return error;
}

_Static_assert(sizeof(struct channel_limits) == 3 * sizeof(uint32_t), "fields of LIMIT, STORE and their replies");

static void note_limits(uint32_t *values, uint32_t number, const struct channel_limits *limits)
{
    values[0] = number;
    *(struct channel_limits *)&values[1] = limits[number];
}

static enum error limit(struct generator *generator, const uint32_t *fields, uint32_t *values)
{
    const enum error error = safety_tighten(generator, fields[0], (const struct channel_limits *)&fields[1]);
    if (!error)
        note_limits(values, fields[0], generator->limits);
    return error;
}

static enum error store(struct generator *generator, const uint32_t *fields, uint32_t *values)
{
    const enum error error = safety_store_limits(generator, (const struct channel_limits *)fields);
    values[0] = (uint32_t)generator->stored;
    return error;
}

/* Read anew from the memory of the board. */
static enum error stored(struct generator *generator, const uint32_t *fields, uint32_t *values)
{
    struct channel_limits limits[CHANNEL_COUNT];
    const enum error error = safety_check_dark(generator);
    if (error)
        return error;
    if (fields[0] >= CHANNEL_COUNT)
        return ERROR_CHANNEL;
    values[0] = (uint32_t)stored_limits_read(limits);
    note_limits(values + 1, fields[0], limits);
    return ERROR_NONE;
}

static enum error load(struct generator *generator, const uint32_t *fields, uint32_t *values)
{
    (void)fields;
    const enum error error = safety_load(generator);
    if (error)
        return error;
    values[0] = generator->train_id;
    values[1] = pulse_train_length_ns(&generator->train);
    values[2] = channel_limits_period_us(&generator->train, generator->limits);
    return ERROR_NONE;
}

static enum error arm(struct generator *generator, const uint32_t *fields, uint32_t *values)
{
    const enum error error = shooting_arm(generator, fields[0], fields[1], fields[2]);
    values[0] = generator->train_id;
    values[1] = generator->shots_left;
    return error;
}

static enum error fire(struct generator *generator, const uint32_t *fields, uint32_t *values)
{
    (void)fields;
    const enum error error = shooting_fire(generator);
    values[0] = generator->counters.fired;
    values[1] = generator->train_id;
    values[2] = generator->shots_left;
    return error;
}

static enum error give_light(struct generator *generator, const uint32_t *fields, uint32_t *values)
{
    const enum error error = light_start(generator, fields[0], fields + 1);
    values[0] = (uint32_t)generator->state;
    return error;
}

static enum error shot(struct generator *generator, const uint32_t *fields, uint32_t *values)
{
    if (fields[0] >= CHANNEL_COUNT)
        return ERROR_CHANNEL;
    const struct channel *fired = &generator->train.channels[fields[0]];
    if (!generator->fired || !fired->used)
        return ERROR_NO_SHOT;
    values[0] = generator->counters.fired;
    note_channel(values + 1, fields[0], fired, port_tick_ns);
    return ERROR_NONE;
}

_Static_assert(sizeof(struct counters) == 7 * sizeof(uint32_t) &&
                   sizeof(struct port_line_errors) == 4 * sizeof(uint32_t),
               "the last fields of STATUS");

static enum error status(struct generator *generator, const uint32_t *fields, uint32_t *values)
{
    (void)fields;
    values[0] = (uint32_t)generator->state;
    values[1] = generator->faults;
    values[2] = generator->interlock_closed;
    values[3] = generator->estop_closed;
    values[4] = (uint32_t)generator->source;
    values[5] = generator->shots_left;
    *(struct counters *)&values[6] = generator->counters;
    *(struct port_line_errors *)&values[13] = port_line_errors();
    return ERROR_NONE;
}

static enum error beat(struct generator *generator, const uint32_t *fields, uint32_t *values)
{
    (void)fields;
    values[0] = (uint32_t)generator->state;
    return ERROR_NONE;
}

static enum error off(struct generator *generator, const uint32_t *fields, uint32_t *values)
{
    safety_off(generator);
    return beat(generator, fields, values);
}

static enum error clear(struct generator *generator, const uint32_t *fields, uint32_t *values)
{
    (void)fields;
    const enum error error = safety_clear(generator);
    values[0] = (uint32_t)generator->state;
    return error;
}

#define EDGES(unit) \
    "channel camera_" unit " a_start_" unit " a_width_" unit " b_start_" unit " b_width_" unit " current_ma"
#define LIMITS "channel max_current_ma max_duty_ppm max_light_ma"
#define COUNTERS "requested fired suppressed early cameras lights crc_errors framing breaks overruns lost"

static const struct command COMMANDS[] = {
    {"NEW", 0, new_train, ""},
    {"LIMIT", 4, limit, LIMITS},
    {"STORE", 12, store, "stored"},
    {"STORED", 1, stored, "stored " LIMITS},
    {"CHANNEL", 9, set_channel, EDGES("ns")},
    {"LOAD", 0, load, "train length_ns period_us"},
    {"ARM", 3, arm, "train shots_left"},
    {"FIRE", 0, fire, "fired train shots_left"},
    {"LIGHT", 5, give_light, "state"},
    {"SHOT", 1, shot, "fired " EDGES("ticks")},
    {"STATUS", 0, status, "state faults interlock estop source shots_left " COUNTERS},
    {"BEAT", 0, beat, "state"},
    {"OFF", 0, off, "state"},
    {"CLEAR", 0, clear, "state"},
};

static const struct command *find(struct span word)
{
    for (size_t i = 0; i < sizeof COMMANDS / sizeof *COMMANDS; i++)
        if (span_equals(word, COMMANDS[i].word))
            return &COMMANDS[i];
    return NULL;
}

void commands_run(struct generator *generator, struct span word, struct span rest, struct answer *answer)
{
    uint32_t fields[MAX_FIELDS] = {0};
    const struct command *command = find(word);
    answer->error = command ? ERROR_NONE : ERROR_UNKNOWN_COMMAND;
    if (!command)
        return;
    for (uint32_t i = 0; i < command->field_count; i++)
        if (!span_number(span_next_word(&rest), &fields[i]))
            answer->error = ERROR_SYNTAX;
    if (rest.length)
        answer->error = ERROR_SYNTAX;
    answer->names = command->names;
    if (!answer->error)
        answer->error = command->run(generator, fields, answer->values);
}
