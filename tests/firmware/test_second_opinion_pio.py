"""The state machines' programs once more in an emulator of PIO alone, which shares nothing with the first one.

It takes the programs out of the image, and the words of the next shot out of the memory of the emulated chip.
"""

import re
import struct
import subprocess
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import pytest
from pioemu import State, emulate

from daq.simulation.pico.rp2040_emulator import CYCLE_NS, START_CYCLES
from tests.support.rp2040_board import PAPER, PERIOD_MS, Board, Channel, Waveform, image

OUTPUTS = ("light", "camera")
TRIGGER_BIT, OUTPUT_BIT = 0, 1
TRIGGER_CYCLE = 20
LAST_CYCLE = 60_000


@dataclass(frozen=True)
class Words:
    """What the image pushes into the FIFO of a machine to fire: ``struct words`` of outputs.c."""

    used: bool
    delay: int
    pattern: int


@pytest.fixture(scope="module")
def board() -> Board:
    return Board()


@pytest.fixture(scope="module")
def symbols() -> dict[str, tuple[int, int]]:
    """Address and size of everything in the image."""
    listing = subprocess.run(
        ["arm-none-eabi-nm", "-S", image().with_suffix(".elf")], check=True, capture_output=True, text=True
    ).stdout
    found = re.findall(r"^(\w+) (\w+) \w (\w+)$", listing, re.MULTILINE)
    return {name: (int(address, 16), int(size, 16)) for address, size, name in found}


def memory(board: Board, place: tuple[int, int]) -> bytes:
    address, size = place
    aligned = range(address & ~3, address + size, 4)
    return b"".join(board.pico.read_word(at).to_bytes(4, "little") for at in aligned)[address & 3 :][:size]


def levels(opcodes: list[int], shot: Words) -> Iterator[tuple[int, bool]]:
    """(cycle, level of the output) until the machine asks for the words of another shot."""

    def inputs(state: State) -> int:
        return int(TRIGGER_CYCLE <= state.clock < TRIGGER_CYCLE + 10) << TRIGGER_BIT

    start = State(transmit_fifo=deque([shot.delay, shot.pattern]), pin_directions=1 << OUTPUT_BIT)
    run = emulate(
        opcodes,
        stop_when=lambda _, state: (state.program_counter, len(state.transmit_fifo)) == (0, 0),
        initial_state=start,
        input_source=inputs,
        side_set_base=OUTPUT_BIT,
        side_set_count=1,
    )
    for before, after in run:
        assert before.clock < LAST_CYCLE
        yield before.clock, bool(after.pin_values >> OUTPUT_BIT & 1)


def edges(opcodes: list[int], shot: Words) -> list[tuple[int, bool]]:
    """(ns after the trigger, new level); the machine leaves its output low when it asks for more words."""
    run = [(0, False), *levels(opcodes, shot)]
    run.append((run[-1][0] + 1, False))
    changes = [(cycle, high) for (_, before), (cycle, high) in pairwise(run) if high != before]
    return [((cycle - TRIGGER_CYCLE - START_CYCLES) * CYCLE_NS, high) for cycle, high in changes]


def waveform(board: Board, symbols: dict[str, tuple[int, int]], output: str) -> Waveform:
    """Of the four machines for this output, with the words that FIRE would push."""
    code = memory(board, symbols[f"{output.upper()}_PROGRAM"])
    opcodes = [opcode for (opcode,) in struct.iter_unpack("<H", code)]
    tables = list(struct.iter_unpack("<IxxxxII", memory(board, symbols["words_of"])))
    assert len(tables) == 8, "lights, then cameras"
    shots = [Words(bool(used), *rest) for used, *rest in tables[4 * OUTPUTS.index(output) :][:4]]
    used = {f"{output}{i}": shot for i, shot in enumerate(shots) if shot.used}
    return [(at_ns, name, high) for name, shot in used.items() for at_ns, high in edges(opcodes, shot)]


CLOSE = Channel(0, 0, 200, 600, 200).straddling()
TRIMS = [
    replace(PAPER, camera_ns=8 * i, a_start_ns=20_000 - 8 * i, a_width_ns=1000 + 8 * i, b_width_ns=1000 - 8 * i)
    for i in range(4)
]
PLANS: dict[str, list[Channel | None]] = {
    "paper": [PAPER, None, None, replace(PAPER, current_ma=0)],
    "trims of one tick": list(TRIMS),
    "shortest, closest, at once": [CLOSE, None, CLOSE, None],
    "longest, widest": [None, Channel(0, 8, 2000, 200_008, 2000).straddling(), None, None],
}


@pytest.mark.parametrize("name", PLANS)
def test_both_emulators_see_the_same_edges(board: Board, symbols: dict[str, tuple[int, int]], name: str) -> None:
    board.configure(PLANS[name])
    board.pico.run_ms(2 * PERIOD_MS)
    board.arm(1)
    expected = sorted(edge for output in OUTPUTS for edge in waveform(board, symbols, output))
    assert expected
    assert board.shoot() == expected
