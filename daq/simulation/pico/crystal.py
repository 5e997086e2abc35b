"""The crystal of the emulated chip: what the frequency counter makes of it, and a crystal that fails.

Time in the emulator is that of the processor. A slow crystal slows all of the chip but the ring oscillator, which then
seems fast. One that stands still stops timer and counter; the processor goes on from a PLL without reference, which on
the chip runs at a frequency that nobody states, or stops too. A PLL that has lost its lock changes the processor alone:
the timer then seems to be wrong, and the ring oscillator right.
"""

from rp2040py.rp2040 import RP2040

RING_KHZ = 6500

_CLOCKS, _TIMER = 0x40008, 0x40054
_MIN_KHZ, _MAX_KHZ, _INTERVAL, _SOURCE, _STATUS, _RESULT = 0x84, 0x88, 0x90, 0x94, 0x98, 0x9C
_FIRST, _LAST = 0x80, 0x9C
_PASS, _DONE, _RUNNING, _SLOW, _FAST = 1 << 0, 1 << 4, 1 << 8, 1 << 20, 1 << 24
_WORD = 0xFFFF_FFFF
_TIME_HIGH, _TIME_LOW, _ALARMS, _DEBUG_PAUSE = 0x24, 0x28, range(0x10, 0x20, 4), 0x2C


class Crystal:
    """Stands before the registers of clocks and timer, and has those that rp2040py lacks.

    Parameters
    ----------
    chip : RP2040
        A chip after power-up.
    """

    def __init__(self, chip: RP2040) -> None:
        self._clock = chip.clock
        self._registers: dict[int, int] = {_DEBUG_PAUSE: 0b110}
        self._speed = 1.0
        self._ends_ns = self._counted_khz = 0.0
        self._stopped_us: int | None = None
        self._seen_from_us = self._seen_as_us = 0
        self._seen_speed = 1.0
        clocks, timer = chip.peripherals[_CLOCKS], chip.peripherals[_TIMER]
        self._read_clocks, self._write_clocks = clocks.read_uint32, clocks.write_uint32
        self._read_timer, self._write_timer = timer.read_uint32, timer.write_uint32
        clocks.read_uint32, clocks.write_uint32 = self._read_counter, self._write_counter  # type: ignore[method-assign]
        timer.read_uint32, timer.write_uint32 = self._read_time, self._write_time  # type: ignore[method-assign]

    def change_speed(self, factor: float) -> None:
        """Let it run at this multiple of its nominal frequency."""
        self._speed = factor

    def stop(self) -> None:
        """Let it stand still."""
        self._stopped_us = self._read_timer(_TIME_LOW)
        self._ends_ns = float("inf")

    def start_timer_at(self, time_us: int) -> None:
        """Let the timer begin there instead of at 0."""
        self._seen_as_us = time_us

    def change_pll(self, factor: float) -> None:
        """Let the processor run at this multiple of its nominal frequency, and the crystal as it should."""
        now_us = self._timer_us()
        self._seen_from_us, self._seen_as_us, self._seen_speed = now_us, self._seen_us(now_us), 1 / factor

    def _timer_us(self) -> int:
        return self._read_timer(_TIME_HIGH) << 32 | self._read_timer(_TIME_LOW)

    def _seen_us(self, now_us: int) -> int:
        return self._seen_as_us + int((now_us - self._seen_from_us) * self._seen_speed)

    def _read_counter(self, offset: int) -> int:
        if not _FIRST <= offset <= _LAST:
            return self._read_clocks(offset)
        done = self._clock.nanos >= self._ends_ns
        if offset == _RESULT:
            return int(self._counted_khz * 32) if done else 0
        if offset == _STATUS:
            return self._verdict() if done else _RUNNING
        return self._registers.get(offset, 0)

    def _verdict(self) -> int:
        if self._counted_khz < self._registers.get(_MIN_KHZ, 0):
            return _DONE | _SLOW
        return _DONE | (_FAST if self._counted_khz > self._registers.get(_MAX_KHZ, 0x1FF_FFFF) else _PASS)

    def _write_counter(self, offset: int, value: int) -> None:
        if not _FIRST <= offset <= _LAST:
            self._write_clocks(offset, value)
            return
        self._registers[offset] = value
        if offset == _SOURCE and self._stopped_us is None:
            self._counted_khz = RING_KHZ / self._speed
            self._ends_ns = self._clock.nanos + 1000 * 2 ** self._registers.get(_INTERVAL, 8)

    def _read_time(self, offset: int) -> int:
        if offset == _DEBUG_PAUSE:
            return self._registers[offset]
        if self._stopped_us is not None and offset in (_TIME_HIGH, _TIME_LOW):
            return self._stopped_us if offset == _TIME_LOW else 0
        if offset in (_TIME_HIGH, _TIME_LOW):
            return self._seen_us(self._timer_us()) >> (32 if offset == _TIME_HIGH else 0) & _WORD
        return self._read_timer(offset)

    def _write_time(self, offset: int, value: int) -> None:
        if offset == _DEBUG_PAUSE:
            self._registers[offset] = value
        elif offset not in _ALARMS:
            self._write_timer(offset, value)
        elif self._stopped_us is None:
            self._write_timer(offset, value + self._seen_from_us - self._seen_as_us & _WORD)
