"""What the real image says of a bad serial line: bytes that came damaged, and bytes for which there was no room."""

from itertools import cycle, islice

import pytest

from daq.drivers.pulse_framing import ABORT_BYTE
from daq.drivers.pulse_protocol import Command, Request, State, decode_reply, encode_request
from tests.support.rp2040_board import PAPER, PERIOD_MS, Board

LINE = ("crc_errors", "framing", "breaks", "overruns", "lost")
FRAMING, BREAK, OVERRUN = 1 << 8, 1 << 10, 1 << 11
"""Beside a byte in the data register of the UART."""
RING = 255
BURST, LONGEST_REPLY_MS = 14, 30
NOISE = b"x" * 50 + b"\n"


def counted(board: Board) -> tuple[int, ...]:
    status = board.ask(Command.STATUS)
    return tuple(status.number(name) for name in LINE)


@pytest.mark.parametrize(
    ("flags", "after"),
    [
        (0, (1, 0, 0, 0, 0)),
        (FRAMING, (1, 1, 0, 0, 0)),
        (FRAMING | BREAK, (1, 0, 1, 0, 0)),
        (OVERRUN, (1, 0, 0, 1, 0)),
        (FRAMING | OVERRUN, (1, 1, 0, 1, 0)),
    ],
)
def test_a_byte_that_the_line_has_damaged_is_counted_and_spoils_its_request(flags: int, after: tuple[int, ...]) -> None:
    board = Board()
    board.pico.feed(flags)
    board.pico.run_ms(1)
    assert b"ERR 1*" in board.say(b"9 BEAT*0000\n")
    assert counted(board) == after


def test_an_abort_byte_counts_however_it_arrives() -> None:
    board = Board()
    board.configure([PAPER] * 4)
    board.pico.run_ms(2 * PERIOD_MS)
    board.arm(1)
    board.pico.feed(FRAMING | ABORT_BYTE[0])
    board.pico.run_ms(1)
    assert board.pico.set_points_ma() == (0, 0, 0, 0)
    assert board.ask(Command.STATUS).number("state") == State.SAFE


def test_an_abort_byte_finds_room_in_a_full_ring() -> None:
    board = Board()
    board.configure([PAPER])
    board.pico.run_ms(2 * PERIOD_MS)
    board.arm(1)
    board.pico.pace_serial_line()
    board.send(Command.STATUS)
    board.pico.run_until_received()
    for byte in b"x" * (RING + 10) + ABORT_BYTE:
        board.pico.feed(byte)
        board.pico.run_ms(0.02)
    board.pico.run_ms(40)
    assert board.ask(Command.STATUS).number("state") == State.SAFE


def flooded(count: int, start: int) -> Board:
    """A host that goes on talking while it gets the longest reply there is, from this place of the ring on."""
    board = Board()
    for byte in b"\n" * (start - len(encode_request(Request(1, Command.STATUS, ())))):
        board.pico.feed(byte)
        board.pico.run_ms(0.02)
    board.pico.pace_serial_line()
    board.send(Command.STATUS)
    board.pico.run_until_received()
    for byte in islice(cycle(NOISE), count):
        board.pico.feed(byte)
        board.pico.run_ms(0.02)
    board.pico.run_ms(200)
    return board


def test_what_comes_while_a_long_reply_is_sent_waits_for_its_end() -> None:
    board = flooded(RING, start=RING + 2)
    first, *others = bytes(board.pico.sent).splitlines(keepends=True)
    assert decode_reply(first).error is None
    assert len(others) == RING // len(NOISE), "every line is answered"
    assert counted(board) == (RING // len(NOISE), 0, 0, 0, 0)


def test_what_finds_no_room_is_counted_byte_by_byte() -> None:
    board = flooded(RING + 40, start=RING + 1)
    answered = board.pico.sent.count(b"\n") - 1
    crc_errors, *_, lost = counted(board)
    assert lost == 40
    assert crc_errors == answered == RING // len(NOISE)


def test_a_burst_of_requests_neither_restarts_nor_trips_an_armed_board() -> None:
    """Their replies take longer than the watchdog waits and than a look at the converter may take."""
    board = Board()
    board.configure([PAPER] * 4)
    board.pico.run_ms(2 * PERIOD_MS)
    board.arm(5)
    board.pico.pace_serial_line()
    board.pico.sent.clear()
    board.pico.receive(b"".join(encode_request(Request(100 + i, Command.STATUS, ())) for i in range(BURST)))
    board.pico.run_ms(BURST * LONGEST_REPLY_MS)
    assert board.pico.watchdog_resets == []
    replies = [decode_reply(line) for line in bytes(board.pico.sent).splitlines(keepends=True)]
    assert [reply.sequence for reply in replies] == list(range(100, 100 + BURST))
    assert {(reply.number("state"), reply.number("faults")) for reply in replies} == {(State.ARMED, 0)}
