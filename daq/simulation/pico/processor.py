"""The processor of the emulated chip while no state machine runs, in rp2040py's own loop, which is faster than ours."""

import math
from collections.abc import Callable

from rp2040py.execute_batch import execute_batch
from rp2040py.peripherals.peripheral import BasePeripheral, Peripheral
from rp2040py.rp2040 import RP2040

NEVER_DUE = 1 << 62
"""When a block of state machines is due of which all are stopped or stall."""

_IO_BANK0, _PIO0, _PIO1 = 0x40014, 0x50200, 0x50300


class Processor:
    """Stands where rp2040py expects its own simulator, whose loop asks it for the chip and whether to stop.

    That loop gives a state machine at most one step per instruction; so it ends as soon as one is due. What can start
    one is an access to its registers, or to those of the pins.

    Parameters
    ----------
    chip : RP2040
        Its registers of pins and state machines are watched from now on.
    cycle_ns : int
        Of its clock.
    on_access : Callable[[int], None]
        Told each access of the loop to them before it happens: the cycles since the loop began.
    """

    def __init__(self, chip: RP2040, cycle_ns: int, on_access: Callable[[int], None]) -> None:
        self.rp2040, self.clock = chip, chip.clock
        chip.simulator = self  # type: ignore[assignment]  # without one, PIO would run by itself
        self._core = chip.core
        self._cycle_ns = cycle_ns
        self._on_access = on_access
        self._end = chip.clock.create_alarm(self.interrupt)
        self._running = self._interrupted = False
        self._began_ns = 0.0
        for block in (_IO_BANK0, _PIO0, _PIO1):
            chip.peripherals[block] = _Watched(chip, chip.peripherals[block], self)

    @property
    def stopped(self) -> bool:
        """Whether the loop has to end."""
        return self._interrupted or self._core.waiting

    def interrupt(self) -> None:
        """Run no other instruction."""
        self._interrupted = True

    def run(self, limit_cycles: int) -> int:
        """Until it falls asleep or wakes, is interrupted, has made a state machine due, or time is over; its cycles."""
        self._began_ns = self.clock.nanos
        if self._core.waiting:
            self.clock.tick(self.sleep(limit_cycles) * self._cycle_ns)
        else:
            self._run_loop(limit_cycles)
        return self._cycles()

    def falls_asleep(self) -> bool:
        """Whether it waits for an interrupt now; rp2040py's does so too where a masked one is pending already."""
        if self._core.pending_interrupts & self._core.enabled_interrupts:
            self._core.waiting = False
        return self._core.waiting

    def sleep(self, limit_cycles: int) -> int:
        """Cycles to the next alarm, or to the limit."""
        if not self.clock.has_scheduled_alarm:
            return limit_cycles
        return min(limit_cycles, max(1, math.ceil(self.clock.nanos_to_next_alarm / self._cycle_ns)))

    def _run_loop(self, limit_cycles: int) -> None:
        self._running, self._interrupted = True, False
        self._end.schedule(limit_cycles * self._cycle_ns)
        while not self.stopped:
            execute_batch(self, 1)  # type: ignore[arg-type]
        self._end.cancel()
        self._running = False

    def _cycles(self) -> int:
        return round((self.clock.nanos - self._began_ns) / self._cycle_ns)

    def before_access(self) -> None:
        """Of the loop, or of somebody else."""
        if self._running:
            self._on_access(self._cycles())

    def after_access(self) -> None:
        """State machines are stopped for the loop, which steps them too coarsely."""
        for pio in self.rp2040.pio:
            pio.stopped = True
            if pio.next_due_fp < NEVER_DUE:
                self.interrupt()


class _Watched(BasePeripheral):
    """A block of registers that tells the processor of each access."""

    def __init__(self, chip: RP2040, inner: Peripheral, processor: Processor) -> None:
        super().__init__(chip, "watched")
        self._inner = inner
        self._processor = processor

    def read_uint32(self, offset: int) -> int:
        self._processor.before_access()
        value = self._inner.read_uint32(offset)
        self._processor.after_access()
        return value

    def write_uint32_atomic(self, offset: int, value: int, atomic_type: int) -> None:
        self._processor.before_access()
        self._inner.write_uint32_atomic(offset, value, atomic_type)
        self._processor.after_access()
