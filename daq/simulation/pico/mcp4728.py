"""The converter of the current set-points: an MCP4728 on the I2C bus of the emulated board, bit time by bit time.

Data sheet: Microchip DS22187E. Commands that the firmware does not use are not acknowledged.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

from rp2040py.gpio_pin import GPIOPinState
from rp2040py.peripherals.i2c import I2CMode
from rp2040py.rp2040 import RP2040

ADDRESS = 0x60
CHANNELS = 4
MA_PER_MV = 20
"""Of the drivers behind it: 20 A/V."""

_SUPPLY_MV, _REFERENCE_MV = 3300, 2048
_STEPS = 4096
_CYCLE_NS = 8
_BYTE_BITS = 9
_READY = 0xC0
_RECOVERY_CLOCKS = 9
_EEPROM_NS = 50_000_000


@dataclass(frozen=True)
class Register:
    """What one channel does: input register and output, which are one with the pin LDAC at ground.

    Parameters
    ----------
    internal : bool
        Reference of 2.048 V; else the supply.
    power_down : int
        0 on; 1, 2, 3 pulled to ground by 1, 100, 500 kOhm.
    double : bool
        Gain 2, with the internal reference.
    steps : int
        0 to 4095.
    """

    internal: bool
    power_down: int
    double: bool
    steps: int

    @property
    def output_mv(self) -> float:
        """Voltage of the output."""
        if self.power_down:
            return 0.0
        full_scale_mv = _REFERENCE_MV * (1 + self.double) if self.internal else _SUPPLY_MV
        return min(full_scale_mv * self.steps / _STEPS, _SUPPLY_MV)

    def packed(self) -> bytes:
        """As it is read back."""
        upper = self.internal << 7 | self.power_down << 5 | self.double << 4 | self.steps >> 8
        return bytes((upper, self.steps & 0xFF))


FACTORY = Register(internal=True, power_down=0, double=False, steps=0)


class Mcp4728:
    """One converter; it keeps its registers while the microcontroller restarts.

    Attributes
    ----------
    eeprom : tuple[Register, ...]
        What the channels do after power-up.
    registers : list[Register]
        What they do now.
    connected : bool
        False: nobody answers at the address.
    frozen : bool
        True: every command is acknowledged and none carried out.
    disturbed : int
        So many of the next answers have a wrong bit.
    holding : bool
        True: the data line is held low, as by a converter that was cut off in the middle of a byte; nine clocks end it.
    wedged : bool
        True: no number of clocks ends it.
    """

    def __init__(self) -> None:
        self.eeprom = (FACTORY,) * CHANNELS
        self.registers = list(self.eeprom)
        self.connected, self.frozen, self.holding, self.wedged = True, False, False, False
        self.disturbed = 0
        self._busy_ns = 0.0
        self._now_ns: Callable[[], float] = lambda: 0.0
        self._written = bytearray()
        self._unread = b""
        self._clocks = 0

    def outputs_ma(self) -> tuple[int, ...]:
        """What its outputs ask of the LED drivers, by channel."""
        return tuple(round(register.output_mv * MA_PER_MV) for register in self.registers)

    def power_up(self, chip: RP2040, clock_pin: int) -> None:
        """Connect it to I2C0 of a chip that has just been powered up, as it has been itself."""
        self.registers = list(self.eeprom)
        self.holding = False
        self._busy_ns = 0.0
        self._now_ns = lambda: chip.clock.nanos
        bus = chip.i2c[0]
        finish: list[Callable[[], None]] = []
        alarm = chip.clock.create_alarm(lambda: finish.pop()())

        def after(bits: int, then: Callable[[], None]) -> None:
            finish[:] = [then]
            alarm.schedule(bits * (bus.scl_high_period + bus.scl_low_period) * _CYCLE_NS)

        def start(_repeated: bool) -> None:
            if not self.holding:
                after(1, bus.complete_start)

        def connect(address: int, mode: I2CMode) -> None:
            here = self.connected and address == ADDRESS
            self._begin(mode)
            after(_BYTE_BITS, lambda: bus.complete_connect(here))

        bus.on_start = start
        bus.on_connect = connect
        bus.on_write_byte = lambda value: after(_BYTE_BITS, lambda: bus.complete_write(self._take(value)))
        bus.on_read_byte = lambda _acknowledged: after(_BYTE_BITS, lambda: bus.complete_read(self._give()))
        bus.on_stop = lambda: self._end(lambda: after(1, bus.complete_stop))
        self._follow_resets(chip, alarm.cancel)
        chip.gpio[clock_pin].add_listener(self._count_clock)

    def _follow_resets(self, chip: RP2040, cancel: Callable[[], None]) -> None:
        reset = chip.i2c[0].reset

        def reset_in_mid_byte() -> None:
            self.holding = self.holding or bool(self._unread)
            self._unread = b""
            cancel()
            reset()

        chip.i2c[0].reset = reset_in_mid_byte  # type: ignore[method-assign]

    def _count_clock(self, new: GPIOPinState, _old: GPIOPinState) -> None:
        """Rising edges that somebody gives by hand: a bus without owner."""
        if new is GPIOPinState.LOW:
            return
        self._clocks = self._clocks + 1 if self.holding else 0
        if self._clocks >= _RECOVERY_CLOCKS and not self.wedged:
            self.holding = False

    def _begin(self, mode: I2CMode) -> None:
        self._written.clear()
        ready = _READY if self._now_ns() >= self._busy_ns else _READY & 0x7F
        status = [bytes((ready | i << 4,)) for i in range(CHANNELS)]
        channels = zip(status, self.registers, self.eeprom, strict=True)
        read = mode is I2CMode.READ
        self._unread = b"".join(s + now.packed() + s + kept.packed() for s, now, kept in channels) if read else b""
        if read and self.disturbed:
            self.disturbed -= 1
            self._unread = bytes((self._unread[0] ^ 0x10, *self._unread[1:]))

    def _end(self, then: Callable[[], None]) -> None:
        self._unread = b""
        then()

    def _give(self) -> int:
        value, self._unread = (self._unread[0], self._unread[1:]) if self._unread else (0xFF, b"")
        return value

    def _take(self, value: int) -> bool:
        self._written.append(value)
        command = self._written[0] >> 5
        if command <= 1:
            self._fast_write()
        elif command == 2 and not self._written[0] & 0x18:
            self._multi_write()
        elif command == 2 and self._written[0] & 0x18 == 0x10:
            self._sequential_write()
        else:
            return False
        return True

    def _fast_write(self) -> None:
        """Section 5.6.1: power-down and steps of channel after channel; reference and gain stay."""
        if len(self._written) % 2 == 0:
            channel = (len(self._written) // 2 - 1) % CHANNELS
            upper, lower = self._written[-2:]
            self._set(channel, power_down=upper >> 4 & 3, steps=(upper & 0xF) << 8 | lower)

    def _multi_write(self) -> None:
        """Section 5.6.2: the whole register of the channel that each three bytes name."""
        if len(self._written) % 3 == 0:
            first, upper, lower = self._written[-3:]
            self._set(
                first >> 1 & 3,
                internal=bool(upper & 0x80),
                power_down=upper >> 5 & 3,
                double=bool(upper & 0x10),
                steps=(upper & 0xF) << 8 | lower,
            )

    def _sequential_write(self) -> None:
        """Section 5.6.3: register and EEPROM of all channels from the named one on; then it is busy."""
        first = self._written[0] >> 1 & 3
        if len(self._written) == 1 + 2 * (CHANNELS - first):
            for channel in range(first, CHANNELS):
                upper, lower = self._written[1 + 2 * (channel - first) :][:2]
                fields = {"internal": bool(upper & 0x80), "power_down": upper >> 5 & 3, "double": bool(upper & 0x10)}
                self._set(channel, **fields, steps=(upper & 0xF) << 8 | lower)
            if not self.frozen:
                self.eeprom = (*self.eeprom[:first], *self.registers[first:])
            self._busy_ns = self._now_ns() + _EEPROM_NS

    def _set(self, channel: int, **fields: int | bool) -> None:
        if not self.frozen and self._now_ns() >= self._busy_ns:
            self.registers[channel] = replace(self.registers[channel], **fields)  # type: ignore[arg-type]
