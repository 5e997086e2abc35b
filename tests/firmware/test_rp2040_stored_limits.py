"""The limits that the board keeps in its flash, in the real image: over power cuts, flipped bits and a full sector.

The far end is rp2040py's model of a NOR flash behind the serial interface: commands 02h, 03h, 05h, 06h, and bits that
programming can only clear. The time that a page takes, and what a power cut leaves of it, are put in here.
"""

import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

import pytest

from daq.drivers.pulse_protocol import UNCHANGED, Command, ErrorNumber, Fault, Reply, State, Stored
from tests.support.rp2040_board import BOOT_MS, PAPER, PERIOD_MS, Board

FIRMWARE = Path(__file__).resolve().parents[2] / "firmware"
FIRST, RECORD, RECORDS = 0x1_0000, 64, 64
READ_BYTES = 4 + RECORD
"""Of a command that reads a record."""
KEPT = ((20_000, 100, 300), (0, 0, 0), (30_000, 200, 500), (500, 200, 0))
DARK = ((0, 0, 0),) * 4
ABSOLUTE = ((30_000, 200, 500),) * 4
NAMES = ("max_current_ma", "max_duty_ppm", "max_light_ma")


def store(board: Board, limits: Sequence[tuple[int, int, int]] = KEPT) -> Reply:
    return board.ask_in_bursts(Command.STORE, *(value for channel in limits for value in channel))


def stored(board: Board) -> tuple[Stored, tuple[tuple[int, ...], ...]]:
    replies = [board.ask_in_bursts(Command.STORED, channel) for channel in range(4)]
    return Stored(replies[0].number("stored")), tuple(tuple(map(each.number, NAMES)) for each in replies)


def in_force(board: Board) -> tuple[tuple[int, ...], ...]:
    replies = [board.ask_in_bursts(Command.LIMIT, i, UNCHANGED, UNCHANGED, UNCHANGED) for i in range(4)]
    return tuple(tuple(map(each.number, NAMES)) for each in replies)


def restart(board: Board) -> None:
    board.pico.power_up()
    board.pico.run_ms(BOOT_MS)


def state_and_faults(board: Board) -> tuple[State, Fault]:
    status = board.ask_in_bursts(Command.STATUS)
    return State(status.number("state")), Fault(status.number("faults"))


def test_they_outlast_a_power_cut_and_no_host_can_raise_them() -> None:
    board = Board()
    assert stored(board) == (Stored.NONE, ABSOLUTE)
    assert store(board).number("stored") == Stored.WHOLE
    restart(board)
    assert stored(board) == (Stored.WHOLE, KEPT)
    board.ask_in_bursts(Command.LIMIT, 0, 30_000, 200, 500)
    assert in_force(board) == KEPT
    above = replace(PAPER, current_ma=20_010)
    fields = (above.camera_ns, above.a_start_ns, above.a_width_ns, above.b_start_ns, above.b_width_ns, above.current_ma)
    reply = board.ask(Command.CHANNEL, 0, *fields, above.frame_a_close_ns, above.frame_b_open_ns)
    assert reply.error is ErrorNumber.LIMIT


def test_nothing_is_written_while_armed_and_the_pins_stay_low_while_it_is() -> None:
    board = Board()
    board.configure([PAPER] * 4)
    board.pico.run_ms(2 * PERIOD_MS)
    board.arm(2)
    before = bytes(board.pico.flash.contents)
    assert store(board).error is ErrorNumber.NOT_SAFE
    assert board.pico.flash.contents == before
    board.ask(Command.OFF)
    board.pico.edges.clear()
    assert store(board).error is None
    assert board.pico.edges == []
    assert board.pico.flash.contents[:FIRST] == before[:FIRST], "the image is left alone"


@pytest.mark.parametrize("byte", [0, 5, 30, 55])
def test_a_flipped_bit_of_them_is_no_light_and_a_fault_with_a_name(byte: int) -> None:
    board = Board()
    store(board)
    board.pico.flash.contents[FIRST + byte] ^= 1
    restart(board)
    assert state_and_faults(board) == (State.FAULT, Fault.LIMITS)
    assert board.ask(Command.CLEAR).error is ErrorNumber.HARDWARE
    assert stored(board) == (Stored.DAMAGED, DARK)
    assert in_force(board) == DARK
    assert store(board).error is None
    assert board.ask(Command.CLEAR).error is None
    restart(board)
    assert (state_and_faults(board), stored(board)) == ((State.SAFE, Fault(0)), (Stored.WHOLE, KEPT))


@pytest.mark.parametrize("written", [1, 20, 50])
def test_a_power_cut_in_the_middle_of_storing_is_no_light(written: int) -> None:
    board = Board()
    store(board)
    store(board, ABSOLUTE)
    board.pico.flash.contents[FIRST + RECORD + written : FIRST + 2 * RECORD] = b"\xff" * (RECORD - written)
    restart(board)
    assert state_and_faults(board) == (State.FAULT, Fault.LIMITS)
    assert in_force(board) == DARK


def test_a_record_without_its_first_word_is_damaged() -> None:
    board = Board()
    store(board, ABSOLUTE)
    store(board)
    board.pico.flash.contents[FIRST + RECORD : FIRST + RECORD + 4] = b"\xff" * 4
    assert board.ask(Command.STORED, 0).number("stored") == Stored.DAMAGED


def test_the_newest_count_until_the_sector_is_full() -> None:
    board = Board()
    store(board)
    record = bytes(board.pico.flash.contents[FIRST : FIRST + RECORD])
    board.pico.flash.contents[FIRST : FIRST + (RECORDS - 1) * RECORD] = record * (RECORDS - 1)
    tight = ((10, 1, 0), *KEPT[1:])
    assert store(board, tight).error is None
    assert store(board, KEPT).error is ErrorNumber.HARDWARE
    restart(board)
    assert stored(board) == (Stored.WHOLE, tight)
    end = FIRST + RECORDS * RECORD
    assert not any(byte != 0xFF for byte in board.pico.flash.contents[end : end + RECORD]), (
        "nothing is written behind it"
    )


def test_the_file_that_erases_them_blanks_their_sector_and_nothing_else(tmp_path: Path) -> None:
    subprocess.run([sys.executable, FIRMWARE / "rp2040" / "image.py", tmp_path / "erase.uf2"], check=True)
    file = (tmp_path / "erase.uf2").read_bytes()
    blocks = [file[start : start + 512] for start in range(0, len(file), 512)]
    at = [int.from_bytes(block[12:16], "little") for block in blocks]
    assert at == list(range(0x1000_0000 + FIRST, 0x1000_0000 + FIRST + RECORDS * RECORD, 256))
    assert {block[32 : 32 + 256] for block in blocks} == {b"\xff" * 256}


def test_a_flash_that_does_not_take_them_is_told() -> None:
    board = Board()
    board.pico.flash.contents[FIRST + 12] = 0  # bits that programming cannot set
    restart(board)
    assert store(board, ABSOLUTE).error is None, "it goes behind what is not blank"
    board.pico.flash.protect()
    assert store(board).error is ErrorNumber.HARDWARE
    assert stored(board) == (Stored.WHOLE, ABSOLUTE)


def test_the_interlock_acts_while_the_flash_is_busy() -> None:
    """No interrupt is masked for it, and the image goes on in RAM; a flash that stays busy is waited for 20 ms."""
    board = Board()
    board.pico.flash.keep_busy_ms(5)
    board.send(Command.STORE, *(value for channel in KEPT for value in channel))
    board.pico.run_until_received()
    board.pico.run_ms(2)
    board.pico.set_interlock(False)
    board.pico.run_ms(0.01)
    assert board.pico.read_word(0x4001_40F0 + 4) & 1 << 18 == 0, "its edge has been taken"
    assert b"OK" not in board.pico.sent, "it is not done yet"
    board.pico.run_ms(40)
    assert b"OK stored=1" in board.pico.sent
    assert board.pico.watchdog_resets == []
    assert board.pico.watchdog_resets == []


def test_a_flash_that_stays_busy_is_no_light_and_no_board_without_limits() -> None:
    """It hears no other command meanwhile, and what it is asked reads as blank."""
    board = Board()
    store(board)
    board.pico.flash.keep_busy_ms(250)
    assert store(board, ABSOLUTE).error is ErrorNumber.HARDWARE
    assert board.pico.watchdog_resets == []
    assert in_force(board) == DARK
    assert state_and_faults(board) == (State.FAULT, Fault.LIMITS)
    board.pico.run_ms(250)
    assert stored(board) == (Stored.WHOLE, ABSOLUTE), "it has taken them after all"
    assert board.ask(Command.CLEAR).error is ErrorNumber.HARDWARE, "they are not in force yet"


def test_a_flash_that_does_not_answer_is_no_board_without_limits() -> None:
    board = Board()
    store(board)
    board.pico.flash.fall_silent()
    assert board.ask(Command.STORED, 0).number("stored") == Stored.DAMAGED
    assert store(board).error is ErrorNumber.HARDWARE
    assert in_force(board) == DARK
    assert state_and_faults(board) == (State.FAULT, Fault.LIMITS)


def test_a_flash_that_falls_silent_for_a_while_is_no_board_without_limits() -> None:
    """Whichever of the reads for an answer it swallows: a record at both looks, and none before or after them."""
    board = Board()
    store(board, ABSOLUTE)
    store(board, DARK)
    for first, count in product(range(7), range(1, 4)):
        board.pico.flash.fall_silent(after_bytes=first * READ_BYTES, for_bytes=count * READ_BYTES)
        assert board.ask_in_bursts(Command.STORED, 0).number("max_current_ma") == 0, (first, count)
        board.pico.flash.answer()


def test_nothing_is_written_into_a_flash_that_falls_silent() -> None:
    """It would leave a gap, behind which no record is found."""
    board = Board()
    board.pico.flash.fall_silent(for_bytes=2 * READ_BYTES)
    assert store(board).error is ErrorNumber.HARDWARE
    assert set(board.pico.flash.contents[FIRST : FIRST + RECORDS * RECORD]) == {0xFF}
