#include "outputs.h"

#include "clocks.h"
#include "pins.h"
#include "pio_program.h"
#include "rp2040.h"
#include "set_points.h"

enum {
    LIGHT = 0, /* number of the PIO block */
    CAMERA = 1,
    MACHINES = CHANNEL_COUNT,
    ENABLE_ALL = 0x00f,
    RESTART_ALL = 0x0f0,
    FIFO_DEPTH = 4,
    OUTPUT_OFF = OUTPUT_ENABLE | OUTPUT_LOW,
    OUTPUT_LIVE = OUTPUT_ENABLE,
    CLOCK_DIVIDER_1 = 1 << 16,
    SHIFT_RIGHT = 1 << 18 | 1 << 19,
    SIDE_SET_1 = 1 << 29,
    READY_POLLS = 16,
};

/* The two words of a machine; a machine without a shot stays without words. */
struct words {
    bool used;
    uint32_t delay;
    uint32_t pattern;
};

static struct words light[CHANNEL_COUNT];
static struct words camera[CHANNEL_COUNT];
static volatile uint32_t off_count;

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

static void set_pad(uint32_t pin)
{
    REG(PAD(pin)) = PAD_INPUT | PAD_4_MA | PAD_PULL_DOWN | PAD_SCHMITT;
}

void outputs_start(void)
{
    blocks_restart(RESET_IO_BANK0 | RESET_PADS_BANK0 | RESET_PIO0 | RESET_PIO1);
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
    words->delay = channel->a_start_ns / TICK_NS;
    if (!words->used)
        return true;
    const bool fits = channel->a_start_ns % TICK_NS == 0 && encode(channel->a_width_ns, PULSE_CYCLES_MAX, &a) &&
                      encode(gap_ns, GAP_CYCLES_MAX, &gap) && encode(channel->b_width_ns, PULSE_CYCLES_MAX, &b);
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
    return fits;
}

static void set_up_machine(uint32_t pio, uint32_t machine, uint32_t pin, uint32_t length)
{
    REG(PIO_CLKDIV(pio, machine)) = CLOCK_DIVIDER_1;
    REG(PIO_EXECCTRL(pio, machine)) = (length - 1) << 12; /* wrap after the last instruction */
    REG(PIO_SHIFTCTRL(pio, machine)) = SHIFT_RIGHT;
    REG(PIO_PINCTRL(pio, machine)) = SIDE_SET_1 | PIN_TRIGGER << 15 | pin << 10;
    for (int i = 0; i < FIFO_DEPTH; i++)
        REG(PIO_INSTR(pio, machine)) = PIO_LOW | PIO_PULL_IF_ANY; /* no word of an interrupted shot survives */
    REG(PIO_INSTR(pio, machine)) = PIO_LOW | PIO_JMP(0);
}

static void set_up_block(uint32_t pio, const uint16_t *program, uint32_t length, uint32_t first_pin)
{
    REG(PIO_CTRL(pio)) = RESTART_ALL;
    for (uint32_t i = 0; i < length; i++)
        REG(PIO_INSTR_MEM(pio, i)) = program[i];
    for (uint32_t i = 0; i < MACHINES; i++)
        set_up_machine(pio, i, first_pin + i, length);
    REG(PIO_CTRL(pio)) = ENABLE_ALL;
}

/* Only the pins that the train uses; the others stay forced low. */
static void give_pins(void)
{
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++) {
        if (light[i].used)
            REG(IO_CTRL(PIN_LIGHT + i)) = FUNCTION_PIO0 | OUTPUT_LIVE;
        if (camera[i].used)
            REG(IO_CTRL(PIN_CAMERA + i)) = FUNCTION_PIO1 | OUTPUT_LIVE;
    }
}

static void give_outputs(void)
{
    set_up_block(LIGHT, LIGHT_PROGRAM, sizeof LIGHT_PROGRAM / sizeof *LIGHT_PROGRAM, PIN_LIGHT);
    set_up_block(CAMERA, CAMERA_PROGRAM, sizeof CAMERA_PROGRAM / sizeof *CAMERA_PROGRAM, PIN_CAMERA);
    give_pins();
}

static bool set_currents(const struct pulse_train *train)
{
    uint32_t current_ma[CHANNEL_COUNT];
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++)
        current_ma[i] = train->channels[i].used ? train->channels[i].current_ma : 0;
    return set_points_set(current_ma);
}

bool outputs_load(const struct pulse_train *train)
{
    uint32_t before = interrupts_mask();
    outputs_off();
    const uint32_t off_before = off_count;
    interrupts_restore(before);
    if (!encode_train(train) || !set_currents(train)) /* the set-points take their time, with interrupts on */
        return false;
    before = interrupts_mask();
    const bool still_wanted = off_count == off_before; /* or an OFF that came meanwhile would be undone */
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

static bool waits_for_trigger(uint32_t pio, const struct words *words)
{
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++)
        if (words[i].used && REG(PIO_ADDR(pio, i)) != PIO_TRIGGER_ADDRESS)
            return false;
    return true;
}

void outputs_fire(void)
{
    bool ready = false;
    push_words(LIGHT, light);
    push_words(CAMERA, camera);
    for (int i = 0; i < READY_POLLS && !ready; i++) /* a few cycles; for ever if an interrupt has stopped them */
        ready = waits_for_trigger(LIGHT, light) && waits_for_trigger(CAMERA, camera);
    if (!ready)
        return;
    REG(IO_CTRL(PIN_TRIGGER)) = FUNCTION_NONE | INPUT_HIGH;
    REG(IO_CTRL(PIN_TRIGGER)) = FUNCTION_NONE | INPUT_HIGH; /* long enough for the input synchroniser */
    REG(IO_CTRL(PIN_TRIGGER)) = FUNCTION_NONE | INPUT_LOW;
}
