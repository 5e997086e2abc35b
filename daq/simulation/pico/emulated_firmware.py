"""The firmware's real image behind a pseudo-terminal: an emulated Pico that keeps up with the clock on the wall.

Run as a program, it speaks like the host build of the firmware, ``firmware/host/main.c``::

    python -m daq.simulation.pico.emulated_firmware IMAGE.bin CLOCK

CLOCK is the descriptor of an open file, whose first eight bytes are the Pico's time in seconds, a native double.
What it says of a shot is not what the firmware meant to do, but what its pins did.
"""

import os
import pty
import select
import struct
import sys
import time
import tty
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from daq.simulation.pico.edge import Edge
from daq.simulation.pico.rp2040_chip import CHANNELS, TRIGGER
from daq.simulation.pico.rp2040_emulator import CYCLE_NS, CYCLES_PER_MS, START_CYCLES, EmulatedPico

_BOOT_MS = 5
_NOTICE_MS = 5
"""Time in which the firmware notices what happened around it: two of its polls."""
_WATCHDOG_MS = 250
_SLICE_MS = 2
_LAG_FORGIVEN_MS = 100
_TRIGGER_MS = 0.1
_CYCLES_PER_S = 1000 * CYCLES_PER_MS


class EmulatedFirmware:
    """A Pico, a serial line, and a laboratory to play with.

    Parameters
    ----------
    image : bytes
        The linked image.
    serial_line : int
        File descriptor of the serial line.
    tell : Callable[[str], None]
        Told one line per shot: ``fired COUNT {CHANNEL CAMERA_NS A_START_NS A_WIDTH_NS B_START_NS B_WIDTH_NS
        CURRENT_MA}...``; a pulse that was not given has width 0. ``lit {CHANNEL CURRENT_MA}...`` and ``dark`` when
        continuous light begins and ends.
    clock : int
        File descriptor of the clock.
    """

    def __init__(self, image: bytes, serial_line: int, tell: Callable[[str], None], clock: int) -> None:
        self._pico = EmulatedPico(image)
        self._serial_line = serial_line
        self._tell = tell
        self._clock = clock
        self._fired = 0
        self._lit = False
        self._to_lose = 0
        self._to_damage = 0
        self._pico.run_ms(_BOOT_MS)
        self._show_time()
        self._zero_s = time.monotonic() - self._pico.cycle / _CYCLES_PER_S
        self._instructions: Mapping[str, Callable[[str], None]] = {
            "interlock": lambda level: self._pico.set_interlock(level == "1"),
            "estop": lambda level: self._pico.set_estop(level == "1"),
            "converter": self._set_converter,
            "trigger": self._trigger,
            "reset": self._reset,
            "advance": lambda time_ms: self._skip_ms(int(time_ms)),
            "garbage": lambda data: self._write(bytes.fromhex(data)),
            "noise": self._noise,
            "lose": self._lose,
            "damage": self._damage,
        }

    def catch_up(self) -> None:
        """Let the Pico live up to now; what it cannot catch up with is forgotten."""
        lag_ms = (self._now_cycle() - self._pico.cycle) / CYCLES_PER_MS
        if lag_ms > _LAG_FORGIVEN_MS:
            self._zero_s += (lag_ms - _LAG_FORGIVEN_MS) / 1000
        target = self._now_cycle()
        if self._pico.cycle < target:
            self._run(min(target, self._pico.cycle + _SLICE_MS * CYCLES_PER_MS))

    @property
    def behind(self) -> bool:
        """Whether there is time to catch up with."""
        return self._now_cycle() - self._pico.cycle >= CYCLES_PER_MS

    def receive(self, data: bytes) -> None:
        """Bytes from the host."""
        self._pico.receive(data)

    def instruct(self, line: str) -> bool:
        """Carry out a line of ``firmware/host/control.h``; False if there is no such instruction."""
        word, _, rest = line.partition(" ")
        instruction = self._instructions.get(word)
        if instruction is None:
            return False
        instruction(rest)
        self._skip_ms(_NOTICE_MS)
        return True

    def _now_cycle(self) -> int:
        return int((time.monotonic() - self._zero_s) * _CYCLES_PER_S)

    def _skip_ms(self, time_ms: int) -> None:
        self._zero_s -= time_ms / 1000
        self._run(self._pico.cycle + time_ms * CYCLES_PER_MS)

    def _run(self, until_cycle: int) -> None:
        while self._pico.cycle < until_cycle:
            self._pico.run(until_cycle, lambda: bool(self._pico.sent or self._pico.edges))
            self._report_light()
            self._report_shot()
            self._forward_replies()
            self._show_time()

    def _show_time(self) -> None:
        os.pwrite(self._clock, struct.pack("d", self._pico.cycle / _CYCLES_PER_S), 0)

    def _reset(self, cause: str) -> None:
        if cause == "watchdog":
            self._pico.hang()
            self._skip_ms(_WATCHDOG_MS)
        else:
            self._pico.power_up()
        self._fired = 0
        self._skip_ms(_BOOT_MS)

    def _set_converter(self, working: str) -> None:
        self._pico.converter.connected = working == "1"

    def _trigger(self, _: str) -> None:
        self._pico.set_trigger_pin(True)
        self._pico.run_ms(_TRIGGER_MS)
        self._pico.set_trigger_pin(False)

    def _noise(self, data: str) -> None:
        for byte in bytes.fromhex(data):
            self._pico.feed(byte)
            self._pico.run_ms(1)

    def _lose(self, count: str) -> None:
        self._to_lose = int(count)

    def _damage(self, count: str) -> None:
        self._to_damage = int(count)

    def _report_light(self) -> None:
        """Continuous light has no trigger."""
        edges = self._pico.edges
        lit = self._pico.shooting and (self._lit or (bool(edges) and not any(edge.output == TRIGGER for edge in edges)))
        if lit != self._lit:
            self._lit = lit
            words = (f"{i} {current_ma}" for i, current_ma in enumerate(self._pico.set_points_ma()))
            self._tell(" ".join(("lit", *words)) if lit else "dark")
            edges.clear()
        if lit:
            edges.clear()

    def _report_shot(self) -> None:
        edges = self._pico.edges
        if self._pico.shooting or not edges:
            return
        if any(edge.output.startswith("camera") for edge in edges):
            self._fired += 1
            words = (str(number) for number in measured_shot(edges, self._pico.shot_set_points_ma))
            self._tell(" ".join(("fired", str(self._fired), *words)))
        edges.clear()

    def _forward_replies(self) -> None:
        *lines, rest = bytes(self._pico.sent).split(b"\n")
        self._pico.sent[:] = rest
        for line in lines:
            if self._to_lose:
                self._to_lose -= 1
                continue
            reply = bytearray(line + b"\n")
            if self._to_damage:
                self._to_damage -= 1
                reply[len(reply) // 2] ^= 1
            self._write(bytes(reply))

    def _write(self, data: bytes) -> None:
        """A host that does not read loses replies, as on a wire."""
        try:
            os.write(self._serial_line, data)
        except BlockingIOError:
            return


def measured_shot(edges: Iterable[Edge], set_points_ma: tuple[int, ...]) -> list[int]:
    """Numbers of a shot as its edges have them: seven for each channel whose camera was triggered."""
    rises: dict[str, list[int]] = {}
    falls: dict[str, list[int]] = {}
    for edge in edges:
        (rises if edge.high else falls).setdefault(edge.output, []).append(edge.cycle)
    first = min(cycles[0] for output, cycles in rises.items() if output != TRIGGER)
    zero = max(cycle for cycle in rises[TRIGGER] if cycle <= first) + START_CYCLES
    numbers: list[int] = []
    for i in range(CHANNELS):
        pulses = list(zip(rises.get(f"light{i}", []), falls.get(f"light{i}", []), strict=True))
        pulses += [(zero, zero)] * (2 - len(pulses))
        spans = [(CYCLE_NS * (on - zero), CYCLE_NS * (off - on)) for on, off in pulses]
        if f"camera{i}" in rises:
            camera_ns = CYCLE_NS * (rises[f"camera{i}"][0] - zero)
            numbers += [i, camera_ns, *spans[0], *spans[1], set_points_ma[i]]
    return numbers


def _print(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def _open_terminal() -> tuple[int, str]:
    """Master end, and name of the slave, which stays open here: without a reader the master would report a hang-up."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    return master, os.ttyname(slave)


def _serve(firmware: EmulatedFirmware, serial_line: int) -> None:
    """Until the end of stdin, so that it never outlives its owner."""
    unread = b""
    while True:
        wait_s = 0.0 if firmware.behind else _SLICE_MS / 1000
        readable, _, _ = select.select([serial_line, sys.stdin], [], [], wait_s)
        if serial_line in readable:
            firmware.receive(os.read(serial_line, 256))
        firmware.catch_up()
        if sys.stdin in readable:
            data = os.read(sys.stdin.fileno(), 4096)
            if not data:
                return
            *lines, unread = (unread + data).split(b"\n")
            for line in lines:
                _print("done" if firmware.instruct(line.decode()) else "unknown")


def main() -> None:
    """Serve until stdin ends; nobody is told the port before the firmware has started."""
    serial_line, port = _open_terminal()
    firmware = EmulatedFirmware(Path(sys.argv[1]).read_bytes(), serial_line, _print, int(sys.argv[2]))
    _print(f"port {port}")
    _serve(firmware, serial_line)


if __name__ == "__main__":
    main()
