"""Damage in the chip: a bit that flips in flash, in RAM or in the state machines, a line that is stuck."""

import itertools
import struct
from collections.abc import Iterator
from dataclasses import replace

import pytest

from daq.drivers.pulse_protocol import Command, ErrorNumber, Fault, Source, State, decode_reply
from daq.simulation.pico.firmware_build import ImageKind
from daq.simulation.pico.rp2040_chip import PIN_LIGHT
from daq.simulation.pico.rp2040_emulator import CYCLES_PER_MS, EmulatedPico
from tests.support.rp2040_board import BOOT_MS, PAPER, PERIOD_MS, Board, image, state_and_faults

LIT_AT_MOST_MS = 1.0
"""For which the tables permit 25 to 40 A."""
LOOK_WITHIN_MS = 2.1
"""While nothing can be lit."""
SETTLED_MS = 25
TWO_ROUNDS_MS = 4000
"""Of the check of the image in RAM: a place that it has just passed is found at the end of the next."""
LIGHT_PROGRAM = struct.pack("<3H", 0x80A0, 0xA027, 0x80A0)
PULL_WITH_LIGHT = 0x90A0
PIO_BLOCKS = (0x5020_0000, 0x5030_0000)
INSTRUCTIONS = 0x48
LIGHT_CTRL = [0x4001_4004 + 8 * (PIN_LIGHT + i) for i in range(4)]
FORCED_HIGH = 3 << 12 | 3 << 8
WATCHDOG_MS = 200


@pytest.fixture
def board() -> Iterator[Board]:
    """Armed, and as soon as it is damaged, dark."""
    board = Board()
    board.pico.run_ms(SETTLED_MS)
    board.configure([PAPER] * 4)
    board.arm(100)
    board.pico.edges.clear()
    yield board
    assert not any(board.pico.levels().values())


def longest_light_ms(board: Board) -> float:
    """Of all pulses of light until now, those that have not ended too."""
    longest = 0
    for number in range(4):
        edges = [(edge.cycle, edge.high) for edge in board.pico.edges if edge.output == f"light{number}"]
        edges.append((board.pico.cycle, False))
        ends = [after - cycle for (cycle, high), (after, _) in itertools.pairwise(edges) if high]
        longest = max([longest, *ends])
    return longest / CYCLES_PER_MS


@pytest.mark.parametrize("kind", ImageKind)
def test_an_image_with_a_flipped_bit_in_the_light_program_is_not_run(kind: ImageKind) -> None:
    """The first instruction would hold all lights high as long as it waits, which is always."""
    content = bytearray(image(kind).read_bytes())
    content[content.index(LIGHT_PROGRAM) + 1] ^= 0x10
    pico = EmulatedPico(bytes(content))
    pico.run_ms(2 * BOOT_MS)
    pico.receive(b"1 OFF\n")
    pico.run_ms(BOOT_MS)
    assert not pico.sent
    assert pico.edges == []


@pytest.mark.parametrize("machine_code_of", ["flash", "RAM"])
def test_the_image_has_no_byte_that_is_not_summed_up(machine_code_of: str) -> None:
    content = bytearray(image().read_bytes())
    content[0x104 if machine_code_of == "flash" else len(content) - 5] ^= 1
    pico = EmulatedPico(bytes(content))
    pico.run_ms(2 * BOOT_MS)
    pico.receive(b"1 OFF\n")
    pico.run_ms(BOOT_MS)
    assert not pico.sent


def test_a_program_that_changes_while_armed_gives_light_for_a_millisecond_at_most(board: Board) -> None:
    """In mid-shot, so that the machines come to the changed instruction, and wait there with their lights high."""
    board.when("light0", True, 10, lambda: board.pico.write_word(PIO_BLOCKS[0] + INSTRUCTIONS, PULL_WITH_LIGHT))
    assert board.ask(Command.FIRE).error is None
    board.pico.run_ms(PERIOD_MS)
    assert longest_light_ms(board) <= LIT_AT_MOST_MS
    assert board.pico.set_points_ma() == (0, 0, 0, 0)
    assert state_and_faults(board) == (State.FAULT, Fault.OUTPUT)
    assert board.ask(Command.CLEAR).error is None
    board.arm(1)
    assert len(board.shoot()) == 4 * len(PAPER.edges(0)), "the next train has a sound program again"


def test_a_program_that_changes_between_shots_is_written_anew_for_the_next(board: Board) -> None:
    """As late as can be: the main loop, too, writes the programs anew, an instruction in a turn."""

    def spoil() -> None:
        for address in range(1, 12):
            board.pico.write_word(PIO_BLOCKS[0] + INSTRUCTIONS + 4 * address, 0x0000)

    assert board.fire_after(spoil) == sorted(edge for i in range(4) for edge in PAPER.edges(i))


def test_a_program_that_changes_while_a_trigger_is_awaited_is_mended(board: Board) -> None:
    board.ask(Command.OFF)
    board.arm(5, Source.EXTERNAL)
    board.pico.run_ms(BOOT_MS)
    board.pico.write_word(PIO_BLOCKS[0] + INSTRUCTIONS + 4 * 9, 0x0000)
    board.pico.run_ms(2 * PERIOD_MS)
    board.pico.edges.clear()
    board.pico.set_trigger_pin(True)
    board.pico.run_ms(1)
    board.pico.set_trigger_pin(False)
    assert board.waveform() == sorted(edge for i in range(4) for edge in PAPER.edges(i))


@pytest.mark.parametrize("armed", [True, False])
def test_a_light_that_is_high_for_no_reason_is_a_fault_in_every_state(board: Board, armed: bool) -> None:
    if not armed:
        board.ask(Command.OFF)
    board.pico.write_word(LIGHT_CTRL[2], FORCED_HIGH | 6)
    board.pico.run_ms(PERIOD_MS)
    assert longest_light_ms(board) <= (LIT_AT_MOST_MS if armed else LOOK_WITHIN_MS)
    assert state_and_faults(board) == (State.FAULT, Fault.OUTPUT)


def test_a_flash_of_light_between_shots_is_a_fault_though_it_is_over(board: Board) -> None:
    board.shoot()
    live = board.pico.read_word(LIGHT_CTRL[1])
    board.pico.write_word(LIGHT_CTRL[1], FORCED_HIGH | 6)
    board.pico.write_word(LIGHT_CTRL[1], live)
    board.pico.run_ms(PERIOD_MS)
    assert state_and_faults(board) == (State.FAULT, Fault.OUTPUT)


def test_a_channel_that_is_dark_in_this_train_has_no_reason_either(board: Board) -> None:
    board.ask(Command.OFF)
    board.configure([PAPER, replace(PAPER, current_ma=0), None, PAPER])
    board.arm(5)
    board.when("light0", True, 10, lambda: board.pico.write_word(LIGHT_CTRL[1], FORCED_HIGH | 6))
    board.shoot()
    assert state_and_faults(board) == (State.FAULT, Fault.OUTPUT)


def test_a_line_that_is_shorted_to_the_supply_is_a_fault_that_lasts(board: Board) -> None:
    board.pico.short("light3")
    board.pico.run_ms(PERIOD_MS)
    assert state_and_faults(board) == (State.FAULT, Fault.OUTPUT)
    assert board.ask(Command.CLEAR).error is ErrorNumber.HARDWARE
    board.pico.power_up()
    board.pico.run_ms(BOOT_MS)
    assert state_and_faults(board) == (State.SAFE, Fault(0))


def test_lights_are_counted_at_the_pins(board: Board) -> None:
    board.shoot()
    board.ask(Command.OFF)
    board.configure([PAPER, None, replace(PAPER, current_ma=0), None])
    board.arm(5)
    board.shoot()
    status = board.ask(Command.STATUS)
    assert [status.number(name) for name in ("fired", "cameras", "lights", "faults")] == [2, 6, 5, 0]


def test_words_that_changed_in_memory_are_not_fired(board: Board) -> None:
    first = PAPER.a_start_ns // 8
    words = [address for address in range(0x2000_0000, 0x2000_4000, 4) if board.pico.read_word(address) == first]
    assert len(words) == 4, "the delays of pulse A"
    board.pico.write_word(words[2], first + 1)
    assert board.ask(Command.FIRE).error is not None
    board.pico.run_ms(PERIOD_MS)
    assert board.pico.edges == []
    assert state_and_faults(board) == (State.FAULT, Fault.INTERNAL)


@pytest.mark.parametrize("armed", [True, False])
def test_code_that_changes_in_memory_is_found_and_stays_a_fault(board: Board, armed: bool) -> None:
    if not armed:
        board.ask(Command.OFF)
    unused = next(a for a in range(0x2000_0400, 0x2000_0500, 4) if board.pico.read_word(a) == vector_of_faults(board))
    board.pico.write_word(unused, 0)
    for _ in range(TWO_ROUNDS_MS // 500):
        board.pico.run_ms(500)
        if state_and_faults(board)[0] is State.FAULT:
            break
    for _ in range(TWO_ROUNDS_MS // 500):
        assert state_and_faults(board) == (State.FAULT, Fault.INTERNAL)
        assert board.ask(Command.CLEAR).error is ErrorNumber.HARDWARE
        board.pico.run_ms(500)
    board.pico.power_up()
    board.pico.run_ms(BOOT_MS)
    assert state_and_faults(board) == (State.SAFE, Fault(0))


def vector_of_faults(board: Board) -> int:
    """Where exceptions lead that nobody expects: the hard fault, third of the table."""
    return board.pico.read_word(board.pico.read_word(0xE000_ED08) + 4 * 3)


def test_a_restart_by_the_watchdog_finds_no_light(board: Board) -> None:
    """The level of a pin that was high when the chip was reset is not taken for light after it."""
    board.pico.write_word(LIGHT_CTRL[0], FORCED_HIGH | 6)
    board.pico.hang()
    board.pico.run_ms(WATCHDOG_MS + BOOT_MS)
    assert state_and_faults(board) == (State.FAULT, Fault.WATCHDOG)


def test_replies_are_whole_while_all_of_that_goes_on(board: Board) -> None:
    replies = [decode_reply(board.say(b"?\n")) for _ in range(3)]
    assert {reply.error for reply in replies} == {ErrorNumber.CRC}
