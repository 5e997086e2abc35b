"""The firmware's real image on an emulated Pico, asked over its serial line; all time is virtual."""

import os
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, replace
from functools import cache
from pathlib import Path

import pytest

from daq.drivers.pulse_protocol import (
    MAX_SEQUENCE,
    Command,
    Fault,
    Reply,
    Request,
    Source,
    State,
    decode_reply,
    encode_request,
)
from daq.simulation.pico.edge import Edge
from daq.simulation.pico.firmware_build import ImageKind, build_image
from daq.simulation.pico.rp2040_chip import TRIGGER
from daq.simulation.pico.rp2040_emulator import CYCLE_NS, CYCLES_PER_MS, START_CYCLES, EmulatedPico
from daq.simulation.pico.serial_pace import BYTE_NS

PERIOD_MS = 10
CAMERA_PULSE_NS = 10_000
BOOT_MS = 5
REPLY_LIMIT_MS = 60
BURST, BURST_MS = 8, 0.2

IMAGES_VARIABLE = "TOMOSHADOW_IMAGES"
"""Names a folder with the images to test, instead of those that are built here; mutants.py does."""

Waveform = list[tuple[int, str, bool]]
"""(time in ns after the trigger of the shot, output, level), in order of time and name."""


@dataclass(frozen=True)
class Channel:
    """Fields of the command CHANNEL, after the number."""

    camera_ns: int
    a_start_ns: int
    a_width_ns: int
    b_start_ns: int
    b_width_ns: int
    current_ma: int = 20_000
    frame_a_close_ns: int = 0
    frame_b_open_ns: int = 0

    def straddling(self) -> "Channel":
        """The same, with a frame boundary amid the pulses."""
        middle_ns = max(0, (self.a_start_ns + self.a_width_ns + self.b_start_ns) // 2 - self.camera_ns)
        return replace(self, frame_a_close_ns=middle_ns, frame_b_open_ns=middle_ns)

    def edges(self, number: int) -> Waveform:
        """What the outputs of the channel have to do."""
        camera = [(self.camera_ns, True), (self.camera_ns + CAMERA_PULSE_NS, False)]
        starts = ((self.a_start_ns, self.a_width_ns), (self.b_start_ns, self.b_width_ns))
        light = [edge for at, width in starts for edge in ((at, True), (at + width, False))] if self.current_ma else []
        return [(at, f"camera{number}", high) for at, high in camera] + [(at, f"light{number}", h) for at, h in light]


PAPER = Channel(0, 20_000, 1000, 26_400, 1000, frame_a_close_ns=23_500, frame_b_open_ns=23_800)
"""The paper's pulse pair: 1 us, 6.4 us apart."""


@cache
def image(kind: ImageKind = ImageKind.CONVERTER) -> Path:
    """The image under test."""
    folder = os.environ.get(IMAGES_VARIABLE)
    if not folder:
        return build_image(kind=kind)
    path = Path(folder, f"{kind}.bin")
    if not path.exists():
        pytest.exit(f"there is no {path}", returncode=pytest.ExitCode.USAGE_ERROR)
    return path


class Board:
    """One board, and a host that neither checks nor repeats."""

    def __init__(self, kind: ImageKind = ImageKind.CONVERTER) -> None:
        self._use(EmulatedPico(image(kind).read_bytes()))
        self.pico.run_ms(BOOT_MS)

    @classmethod
    def of(cls, pico: EmulatedPico) -> "Board":
        """One that has not started yet."""
        board = cls.__new__(cls)
        board._use(pico)
        return board

    def _use(self, pico: EmulatedPico) -> None:
        self.pico = pico
        self._sequence = 0

    def ask(self, command: Command, *fields: int) -> Reply:
        return decode_reply(self.say(self._line(command, *fields)))

    def send(self, command: Command, *fields: int) -> None:
        """Ask, and let nothing pass yet."""
        self.pico.receive(self._line(command, *fields))

    def _line(self, command: Command, *fields: int) -> bytes:
        self._sequence = self._sequence % MAX_SEQUENCE + 1
        return encode_request(Request(self._sequence, command, fields))

    def say(self, line: bytes) -> bytes:
        """One line to the board, and the line that it answers."""
        self.pico.sent.clear()
        self.pico.receive(line)
        self._await_reply()
        return bytes(self.pico.sent)

    def _await_reply(self) -> None:
        sent, limit = self.pico.sent, self.pico.cycle + REPLY_LIMIT_MS * CYCLES_PER_MS
        assert sent.endswith(b"\n") or self.pico.run(limit, lambda: sent.endswith(b"\n")), sent

    def configure(self, channels: Sequence[Channel | None]) -> list[Reply]:
        """NEW, CHANNEL for each one that is not None, LOAD; the replies to CHANNEL."""
        self.ask_in_bursts(Command.NEW)
        replies = [
            self.ask_in_bursts(Command.CHANNEL, i, *astuple(channel)) for i, channel in enumerate(channels) if channel
        ]
        assert self.ask_in_bursts(Command.LOAD).error is None
        return replies

    def ask_in_bursts(self, command: Command, *fields: int) -> Reply:
        """In the same time as on the serial line, but with the processor asleep in most of it."""
        line, start, sent = self._line(command, *fields), self.pico.cycle, self.pico.sent
        sent.clear()
        for byte in range(0, len(line), BURST):
            for each in line[byte : byte + BURST]:
                self.pico.feed(each)
            self.pico.run_ms(BURST_MS)
        self._await_reply()
        self.pico.run(start + len(line) * BYTE_NS // CYCLE_NS)
        return decode_reply(bytes(sent))

    def arm(self, shots: int, source: Source = Source.COMMAND, period_us: int = 0) -> None:
        assert self.ask(Command.ARM, shots, source, period_us).error is None

    def fire_after(self, change: Callable[[], None]) -> Waveform:
        """Fire as ``shoot`` does; something changes just before the last byte of the request."""
        line = self._line(Command.FIRE)
        self.pico.receive(line[:-1])
        self.pico.run_ms(1)
        self.pico.edges.clear()
        self.pico.sent.clear()
        change()
        self.pico.feed(line[-1])
        self._await_reply()
        self.pico.run_ms(PERIOD_MS)
        return self.waveform()

    def shoot(self, time_ms: float = PERIOD_MS) -> Waveform:
        """Fire, let the period pass, and measure what the outputs did."""
        self.pico.edges.clear()
        reply = self.ask(Command.FIRE)
        assert reply.error is None, reply
        self.pico.run_ms(time_ms)
        return self.waveform()

    def waveform(self) -> Waveform:
        edges = self.pico.edges
        first = next(edge.cycle for edge in edges if edge.output != TRIGGER)
        start = max(e.cycle for e in edges if e.output == TRIGGER and e.high and e.cycle <= first) + START_CYCLES
        return sorted(((e.cycle - start) * CYCLE_NS, e.output, e.high) for e in edges if e.output != TRIGGER)

    def when(self, output: str, high: bool, after_cycles: int, action: Callable[[], None]) -> None:
        """Do something once, some cycles after an output changes."""

        def watch(edge: Edge) -> None:
            if (edge.output, edge.high) == (output, high):
                self.pico.on_edge = None
                self.pico.at(edge.cycle + after_cycles, action)

        self.pico.on_edge = watch


def state_and_faults(board: Board) -> tuple[State, Fault]:
    """What a board says of itself."""
    status = board.ask(Command.STATUS)
    return State(status.number("state")), Fault(status.number("faults"))
