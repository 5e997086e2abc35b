"""One bit flips at a random place of an armed board: it then is dark, or its shot is still right."""

import os
import random
from collections import Counter
from collections.abc import Iterator
from enum import StrEnum

import pytest

from daq.drivers.pulse_protocol import Command
from daq.simulation.pico.rp2040_emulator import CYCLES_PER_MS, EmulatedPico
from tests.firmware.test_rp2040_damage import LIT_AT_MOST_MS, longest_light_ms
from tests.support.rp2040_board import PAPER, PERIOD_MS, Board, image

FLIPS_VARIABLE = "TOMOSHADOW_FLIPS"
FLIPS = int(os.environ.get(FLIPS_VARIABLE, "9"))
"""How many; `make flips` takes 200."""
BOOT_STAGE = 256
RAM, RAM_BYTES = 0x2000_0000, 16 * 1024
SETTLED_MS = 25
ANSWER_MS = 60
RIGHT = sorted(edge for i in range(4) for edge in PAPER.edges(i))


class Outcome(StrEnum):
    """What became of the light."""

    DARK = "dark"
    RIGHT = "right"


def armed(content: bytes) -> Board:
    """A board with these bytes in its flash, armed if it speaks."""
    board = Board()
    board.pico = EmulatedPico(content)
    board.pico.run_ms(SETTLED_MS)
    for command, fields in [
        (Command.NEW, ()),
        *((Command.CHANNEL, (i, *vars(PAPER).values())) for i in range(4)),
        (Command.LOAD, ()),
        (Command.ARM, (5, 0, 0)),
    ]:
        say(board, command, *fields)
    return board


def say(board: Board, command: Command, *fields: int) -> None:
    """Ask, and wait for an answer that may not come."""
    sent = board.pico.sent
    sent.clear()
    board.send(command, *fields)
    board.pico.run(board.pico.cycle + ANSWER_MS * CYCLES_PER_MS, lambda: sent.endswith(b"\n"))


def outcome(board: Board) -> Outcome | None:
    """Of the next shot; None is neither."""
    say(board, Command.FIRE)
    board.pico.run_ms(PERIOD_MS)
    if longest_light_ms(board) > LIT_AT_MOST_MS or any(board.pico.levels().values()):
        return None
    lights = [edge for edge in board.pico.edges if edge.output.startswith("light")]
    if not lights:
        return Outcome.DARK
    return Outcome.RIGHT if board.waveform() == RIGHT else None


def flip_flash(chance: random.Random) -> tuple[Board, str]:
    content = bytearray(image().read_bytes())
    place, bit = chance.randrange(BOOT_STAGE, len(content)), chance.randrange(8)
    content[place] ^= 1 << bit
    return armed(bytes(content)), f"flash {place:#x} bit {bit}"


def flip_ram(chance: random.Random) -> tuple[Board, str]:
    board = armed(image().read_bytes())
    address, bit = RAM + 4 * chance.randrange(RAM_BYTES // 4), chance.randrange(32)
    board.pico.write_word(address, board.pico.read_word(address) ^ 1 << bit)
    return board, f"RAM {address:#x} bit {bit}"


def flip_program(chance: random.Random) -> tuple[Board, str]:
    """Of the light; the memory of the machines can be written, and what stands there is known."""
    board = armed(image().read_bytes())
    address, bit = chance.randrange(12), chance.randrange(16)
    board.pico.flip_instruction(0, address, bit)
    return board, f"instruction {address} bit {bit}"


PLACES = {"flash": flip_flash, "RAM": flip_ram, "program": flip_program}


@pytest.fixture(scope="module")
def tally(request: pytest.FixtureRequest) -> Iterator[Counter[str]]:
    """What became of each place; told at the end, where somebody has asked for many."""
    counts: Counter[str] = Counter()
    yield counts
    if FLIPS_VARIABLE in os.environ:
        with request.config.pluginmanager.getplugin("capturemanager").global_and_fixture_disabled():
            print("\n" + ", ".join(f"{name}: {count}" for name, count in sorted(counts.items())))  # noqa: T201


@pytest.mark.parametrize("number", range(FLIPS))
def test_a_flipped_bit_leaves_it_dark_or_right(number: int, tally: Counter[str]) -> None:
    place = list(PLACES)[number % len(PLACES)]
    board, where = PLACES[place](random.Random(number))
    found = outcome(board)
    tally[f"{place} {found or 'neither'}"] += 1
    assert found is not None, f"{where}: {board.pico.edges[-12:]}"
