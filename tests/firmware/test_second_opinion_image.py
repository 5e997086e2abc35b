"""The whole image once more in rp2040js, an emulator by other people: same lines in, same edges and answers out.

It is the only emulator that models the clock tree, and the only one whose PWM drives pins.
"""

import json
import os
import re
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from daq.drivers.pulse_protocol import Command, Reply, Request, decode_reply, encode_request
from daq.simulation.pico.firmware_build import ImageKind
from daq.simulation.pico.rp2040_chip import OUTPUT_PINS, PIN_ESTOP, PIN_INTERLOCK, PIN_SET_POINT, PIN_TRIGGER
from daq.simulation.pico.rp2040_emulator import CYCLE_NS, START_CYCLES
from tests.support.rp2040_board import BOOT_MS, PAPER, PERIOD_MS, Board, Channel, Waveform, image

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "firmware" / "tests" / "rp2040js" / "board.cjs"
MODULES = ROOT / "build" / "rp2040js" / "node_modules"
TRIGGER_LINE = -1
FIRST_SHOT_MS = 20
"""After a start nothing is fired for so long."""

pytestmark = pytest.mark.skipif(
    shutil.which("node") is None or not (MODULES / "rp2040js").is_dir(), reason="rp2040js is not installed (make test)"
)


@dataclass(frozen=True)
class Told:
    """What rp2040js says of a session."""

    replies: list[Reply]
    edges: list[tuple[int, int, bool]]
    set_points: list[int]
    clocks: dict[str, float]

    def waveform(self) -> Waveform:
        """Of the last shot."""
        names = {pin: name for name, pin in OUTPUT_PINS.items()}
        rises = [cycle for cycle, pin, high in self.edges if pin == TRIGGER_LINE and high]
        start = rises[-1] + START_CYCLES
        return sorted(
            ((cycle - start) * CYCLE_NS, names[pin], high)
            for cycle, pin, high in self.edges
            if pin in names and cycle >= rises[-1]
        )

    def duty(self, pin: int) -> float:
        """Part of a period that a pin with PWM is high."""
        changes = [(cycle, high) for cycle, number, high in self.edges if number == pin]
        if not changes:
            return 0.0
        (on, _), (off, _), (again, _) = changes[2 if changes[0][1] else 3 :][:3]
        return (off - on) / (again - on)


def session(channels: Sequence[Channel | None]) -> list[Request]:
    """Load, permit and fire one shot."""
    lines: list[tuple[Command, tuple[int, ...]]] = [(Command.ID, ()), (Command.NEW, ())]
    lines += [(Command.CHANNEL, (i, *astuple(channel))) for i, channel in enumerate(channels) if channel]
    lines += [(Command.LOAD, ()), (Command.ARM, (1, 0, 0)), (Command.STATUS, ()), (Command.FIRE, ())]
    return [Request(number, command, fields) for number, (command, fields) in enumerate(lines, 1)]


def in_rp2040js(requests: Sequence[Request], kind: ImageKind = ImageKind.CONVERTER) -> Told:
    steps: list[list[Any]] = [["pin", PIN_INTERLOCK, 1], ["pin", PIN_ESTOP, 1], ["run", BOOT_MS + FIRST_SHOT_MS]]
    steps += [["say", encode_request(request).decode()] for request in requests]
    steps += [["run", PERIOD_MS]]
    finished = subprocess.run(
        ["node", PROGRAM, image(kind), str(PIN_TRIGGER)],
        input=json.dumps(steps),
        capture_output=True,
        text=True,
        timeout=60,
        env=os.environ | {"NODE_PATH": str(MODULES)},
    )
    assert finished.returncode == 0, finished.stderr
    told = json.loads(finished.stdout)
    edges = [(cycle, pin, bool(level)) for cycle, pin, level in told["edges"]]
    return Told([decode_reply(line.encode()) for line in told["replies"]], edges, told["set_points"], told["clocks"])


def in_rp2040py(requests: Sequence[Request]) -> tuple[list[Reply], Waveform]:
    board = Board()
    board.pico.run_ms(FIRST_SHOT_MS)
    replies = [decode_reply(board.say(encode_request(request))) for request in requests]
    board.pico.run_ms(PERIOD_MS)
    return replies, board.waveform()


LATE = Channel(3000, 150_000, 200, 350_000, 1992, 9_900).straddling()
PLANS: dict[str, list[Channel | None]] = {
    "paper": [PAPER] * 4,
    "trims, leads and a dark channel": [
        replace(PAPER, camera_ns=1000, a_start_ns=20_008, a_width_ns=992),
        replace(PAPER, current_ma=0),
        None,
        replace(PAPER, a_start_ns=19_992, b_start_ns=26_408, b_width_ns=1008, current_ma=12_340),
    ],
    "shortest and closest, at once": [None, Channel(0, 0, 200, 600, 200).straddling(), None, None],
    "longest and widest": [Channel(0, 8, 2000, 200_008, 2000).straddling(), LATE, None, PAPER],
    "off the grid": [
        replace(PAPER, a_start_ns=20_003, a_width_ns=1005, b_start_ns=26_397, b_width_ns=251),
        *[None] * 3,
    ],
}


def comparable(reply: Reply) -> Reply:
    """rp2040js has neither the number of the flash nor the register that tells why the chip has started."""
    fields = {name: value for name, value in reply.fields.items() if name not in ("serial", "cause")}
    return replace(reply, boot=0, fields=fields)


@pytest.mark.parametrize("name", PLANS)
def test_both_emulators_see_the_same_edges_and_answers(name: str) -> None:
    requests = session(PLANS[name])
    replies, waveform = in_rp2040py(requests)
    other = in_rp2040js(requests)
    assert [comparable(reply) for reply in other.replies] == [comparable(reply) for reply in replies]
    assert waveform
    assert other.waveform() == waveform


def test_the_clock_tree_gives_8_ns_from_a_crystal_of_12_mhz() -> None:
    told = in_rp2040js([Request(1, Command.ID, ())])
    clocks = told.clocks
    header = (ROOT / "firmware" / "rp2040" / "chip" / "clocks.h").read_text()
    (clock_mhz,) = re.findall(r"CLOCK_MHZ = (\d+)", header)
    assert clocks["sys_hz"] == clocks["pll_hz"] == int(clock_mhz) * 1e6 == 1e9 / CYCLE_NS
    assert clocks["ref_hz"] == 12e6, "timer and watchdog count microseconds of the crystal"
    assert clocks["peri_hz"] == clocks["sys_hz"]
    assert clocks["baud"] == pytest.approx(115_200, rel=1e-3)


CURRENTS_MA = (0, 9_900, 20_000, 29_990)
LIT = [replace(PAPER, current_ma=current_ma) for current_ma in CURRENTS_MA]


def test_set_points_are_in_the_converter_when_the_shot_starts() -> None:
    on, off = 0x8000, 0x2000
    assert in_rp2040js(session(LIT)).set_points == [
        on | current_ma // 10 if current_ma else off for current_ma in CURRENTS_MA
    ]


def test_without_a_converter_set_points_are_the_duty_of_their_pins() -> None:
    told = in_rp2040js(session(LIT)[:-1], ImageKind.PWM)
    for i, current_ma in enumerate(CURRENTS_MA):
        assert told.duty(PIN_SET_POINT + i) == pytest.approx(current_ma / 30_000, abs=2e-3)
