#include "outputs.h"

#include "clocks.h"
#include "pins.h"
#include "pio_program.h"
#include "resets.h"
#include "rp2040.h"
#include "set_points.h"
#include "state_machines.h"
#include "sum.h"

enum {
    OUTPUT_OFF = OUTPUT_ENABLE | OUTPUT_LOW,
    OUTPUT_LIVE = OUTPUT_ENABLE,
    READY_POLLS = 16,
    CAMERAS_BELOW_8 = 8 - PIN_CAMERA, /* eight pins have one register */
};

_Static_assert(CHANNEL_COUNT == 4 && PIN_LIGHT + CHANNEL_COUNT <= 8 && (int)CAMERAS_BELOW_8 < (int)CHANNEL_COUNT,
               "registers of edges");

/* The two words of a machine; a machine without a shot stays without words. */
struct words {
    uint32_t used;
    uint32_t single; /* pulse A alone */
    uint32_t delay;
    uint32_t pattern;
};

static struct words words_of[CAMERA + 1][CHANNEL_COUNT];
static struct words *const light = words_of[LIGHT];
static struct words *const camera = words_of[CAMERA];
static uint32_t words_sum;
static bool words_changed;
static volatile uint32_t off_count;
static volatile uint32_t permitted; /* until the shot has started: the register that tells; else 0 */

void outputs_off(void)
{
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++)
        REG(IO_CTRL(PIN_LIGHT + i)) = FUNCTION_PIO0 | OUTPUT_OFF;
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++)
        REG(IO_CTRL(PIN_CAMERA + i)) = FUNCTION_PIO1 | OUTPUT_OFF;
    REG(IO_CTRL(PIN_TRIGGER)) = FUNCTION_NONE | INPUT_LOW;
    REG(PIO_CTRL(LIGHT)) = 0;
    REG(PIO_CTRL(CAMERA)) = 0;
    set_points_zero();
    off_count++;
}

ONCE static void set_pad(uint32_t pin)
{
    REG(PAD(pin)) = PAD_INPUT | PAD_4_MA | PAD_PULL_DOWN | PAD_SCHMITT;
}

ONCE void outputs_start(void)
{
    resets_restart(RESET_IO_BANK0 | RESET_PADS_BANK0 | RESET_PIO0 | RESET_PIO1);
    outputs_off();
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++) {
        set_pad(PIN_LIGHT + i);
        set_pad(PIN_CAMERA + i);
    }
    set_pad(PIN_TRIGGER);
}

static bool encode(uint32_t time_ns, uint32_t limit_cycles, uint32_t *count)
{
    const uint32_t cycles = time_ns / TICK_NS;
    *count = cycles - COUNT_OFFSET;
    return time_ns % TICK_NS == 0 && cycles >= COUNT_OFFSET && cycles <= limit_cycles;
}

static bool encode_light(const struct channel *channel, struct words *words)
{
    uint32_t a = 0;
    uint32_t gap = 0;
    uint32_t b = 0;
    const uint32_t gap_ns = channel->b_start_ns - channel->a_start_ns - channel->a_width_ns;
    words->used = channel->used && channel->current_ma;
    words->single = pulse_train_is_single(channel);
    words->delay = channel->a_start_ns / TICK_NS;
    if (!words->used)
        return true;
    bool fits = channel->a_start_ns % TICK_NS == 0 && encode(channel->a_width_ns, PULSE_CYCLES_MAX, &a);
    if (!words->single)
        fits = fits && encode(gap_ns, GAP_CYCLES_MAX, &gap) && encode(channel->b_width_ns, PULSE_CYCLES_MAX, &b);
    words->pattern = a | gap << WIDTH_BITS | b << (WIDTH_BITS + GAP_BITS);
    return fits;
}

static bool encode_camera(const struct channel *channel, struct words *words)
{
    words->used = channel->used;
    words->delay = channel->camera_ns / TICK_NS;
    return encode(CAMERA_PULSE_NS, CAMERA_CYCLES_MAX, &words->pattern) && channel->camera_ns % TICK_NS == 0;
}

static bool encode_train(const struct pulse_train *train)
{
    bool fits = true;
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++)
        fits = encode_light(&train->channels[i], &light[i]) && encode_camera(&train->channels[i], &camera[i]) && fits;
    words_sum = sum_of(words_of, sizeof words_of);
    words_changed = false;
    return fits;
}

static void set_up_light(void)
{
    state_machines_write_program(LIGHT, LIGHT_PROGRAM, PROGRAM_LENGTH(LIGHT_PROGRAM));
    for (uint32_t i = 0; i < MACHINES; i++)
        state_machines_set_up(LIGHT, i, PIN_LIGHT + i,
                              light[i].single ? LIGHT_SINGLE_LENGTH : PROGRAM_LENGTH(LIGHT_PROGRAM));
    state_machines_enable(LIGHT);
}

static void set_up_cameras(void)
{
    state_machines_write_program(CAMERA, CAMERA_PROGRAM, PROGRAM_LENGTH(CAMERA_PROGRAM));
    for (uint32_t i = 0; i < MACHINES; i++)
        state_machines_set_up(CAMERA, i, PIN_CAMERA + i, PROGRAM_LENGTH(CAMERA_PROGRAM));
    state_machines_enable(CAMERA);
}

void outputs_give_light(uint32_t channel)
{
    REG(IO_CTRL(PIN_LIGHT + channel)) = FUNCTION_PIO0 | OUTPUT_LIVE;
}

/* Only the pins that the train uses; the others stay forced low. */
static void give_pins(void)
{
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++) {
        if (light[i].used)
            outputs_give_light(i);
        if (camera[i].used)
            REG(IO_CTRL(PIN_CAMERA + i)) = FUNCTION_PIO1 | OUTPUT_LIVE;
    }
}

static void give_outputs(void)
{
    set_up_light();
    set_up_cameras();
    give_pins();
}

static bool set_currents(const struct pulse_train *train)
{
    uint32_t current_ma[CHANNEL_COUNT];
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++)
        current_ma[i] = train->channels[i].used ? train->channels[i].current_ma : 0;
    return set_points_set(current_ma);
}

uint32_t outputs_switch_off(void)
{
    const uint32_t before = interrupts_mask();
    outputs_off();
    permitted = 0;
    const uint32_t count = off_count;
    interrupts_restore(before);
    return count;
}

bool outputs_mask_unless_off(uint32_t off_before, uint32_t *before)
{
    *before = interrupts_mask();
    return off_count == off_before;
}

bool outputs_load(const struct pulse_train *train)
{
    const uint32_t off_before = outputs_switch_off();
    if (!encode_train(train) || !set_currents(train)) /* the set-points take their time, with interrupts on */
        return false;
    uint32_t before = 0;
    const bool still_wanted = outputs_mask_unless_off(off_before, &before);
    if (still_wanted)
        give_outputs();
    interrupts_restore(before);
    return still_wanted;
}

static void push_words(uint32_t pio, const struct words *words)
{
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++) {
        if (words[i].used) {
            REG(PIO_TXF(pio, i)) = words[i].delay;
            REG(PIO_TXF(pio, i)) = words[i].pattern;
        }
    }
}

static bool all_stand_at(uint32_t pio, const struct words *words, uint32_t address)
{
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++)
        if (words[i].used && REG(PIO_ADDR(pio, i)) != address)
            return false;
    return true;
}

/* Words for one shot, and wait until all machines stand at the wait for the trigger line: a few cycles, or for ever if
 * an interrupt has stopped them. */
static bool push_shot(uint32_t address)
{
    bool ready = false;
    words_changed = words_changed || sum_of(words_of, sizeof words_of) != words_sum;
    if (words_changed)
        return false;
    state_machines_refresh();
    push_words(LIGHT, light);
    push_words(CAMERA, camera);
    for (int i = 0; i < READY_POLLS && !ready; i++)
        ready = all_stand_at(LIGHT, light, address) && all_stand_at(CAMERA, camera, address);
    return ready;
}

static void pulse_trigger_line(void)
{
    REG(IO_CTRL(PIN_TRIGGER)) = FUNCTION_NONE | INPUT_HIGH;
    REG(IO_CTRL(PIN_TRIGGER)) = FUNCTION_NONE | INPUT_HIGH; /* long enough for the input synchroniser */
    REG(IO_CTRL(PIN_TRIGGER)) = FUNCTION_NONE | INPUT_LOW;
}

bool outputs_fire(void)
{
    const uint32_t off_before = off_count;
    const bool ready = push_shot(PIO_TRIGGER_ADDRESS);
    uint32_t before = 0;
    const bool start = outputs_mask_unless_off(off_before, &before) && ready;
    if (start)
        pulse_trigger_line();
    interrupts_restore(before);
    return start;
}

/* The machines run in step: where the first camera stands tells of all. */
static uint32_t address_register(void)
{
    uint32_t machine = 0;
    while (machine < CHANNEL_COUNT - 1 && !camera[machine].used)
        machine++;
    return PIO_ADDR(CAMERA, machine);
}

/* All machines have to see the same edge. So the line is held high while they get their words, one after the other:
 * they stand and wait for it to fall. Then one write hands it to the pin. If that is low they all go on to wait for its
 * rise; if it is high they all wait for it to fall first. */
void outputs_permit(void)
{
    const uint32_t off_before = off_count;
    REG(IO_CTRL(PIN_TRIGGER)) = FUNCTION_NONE | INPUT_HIGH;
    const bool ready = push_shot(PIO_TRIGGER_LOW_ADDRESS);
    const uint32_t address = address_register();
    uint32_t before = 0;
    if (outputs_mask_unless_off(off_before, &before) && ready) {
        permitted = address;
        REG(IO_CTRL(PIN_TRIGGER)) = FUNCTION_NONE;
    }
    interrupts_restore(before);
}

/* In few steps: the interlock waits for it. */
bool outputs_take_start(void)
{
    if (!permitted)
        return false;
    const uint32_t address = REG(permitted);
    const bool started = address != PIO_TRIGGER_LOW_ADDRESS && address != PIO_TRIGGER_ADDRESS;
    if (started)
        permitted = 0;
    return started;
}

bool outputs_intact(void)
{
    return !words_changed;
}

/* Rises of the next pins, bits 3, 7, 11, 15; they are latched by the pins themselves, without an interrupt. */
static uint32_t take_rises(uint32_t pin, uint32_t pins)
{
    const uint32_t shift = 4u * (pin % 8u);
    const uint32_t rises = REG(IO_INTR(pin)) & 0x8888u >> 4u * (4u - pins) << shift;
    if (rises)
        REG(IO_INTR(pin)) = rises;
    return rises >> shift;
}

uint32_t outputs_take_lights(void)
{
    const uint32_t rises = take_rises(PIN_LIGHT, CHANNEL_COUNT);
    uint32_t lights = REG(SIO_GPIO_IN) >> PIN_LIGHT & ((1u << CHANNEL_COUNT) - 1u);
    for (uint32_t i = 0; rises && i < CHANNEL_COUNT; i++)
        lights |= (rises >> (4u * i + 3u) & 1u) << i;
    return lights;
}

uint32_t outputs_take_cameras(void)
{
    uint32_t count = 0;
    uint32_t rises = take_rises(PIN_CAMERA, CAMERAS_BELOW_8);
    rises |= take_rises(8, CHANNEL_COUNT - CAMERAS_BELOW_8) << 16;
    for (; rises; rises &= rises - 1u)
        count++;
    return count;
}
