"""Continuous light of the real image: how it is made, and that nothing keeps it on."""

import itertools
from collections.abc import Callable, Iterator

import pytest

from daq.drivers.pulse_framing import ABORT_BYTE
from daq.drivers.pulse_protocol import Command, ErrorNumber, Fault, State
from daq.simulation.pico.rp2040_emulator import CYCLE_NS
from tests.firmware.test_protocol_table import c_enum
from tests.support.rp2040_board import BOOT_MS, PAPER, PERIOD_MS, Board

LIMIT = c_enum("limits.h", "limits")
READY_MS = 25
DARK_WITHIN_NS = 1000


@pytest.fixture
def board() -> Iterator[Board]:
    """Channels 0 and 3 are lit, for a minute."""
    board = Board()
    board.pico.run_ms(READY_MS)
    board.pico.edges.clear()
    assert board.ask(Command.LIGHT, 60_000, 500, 0, 0, 100).error is None
    board.pico.run_ms(5)
    yield board
    board.pico.run_ms(PERIOD_MS)
    assert not any(board.pico.levels().values())


def edges(board: Board, output: str) -> list[tuple[int, bool]]:
    return [(edge.cycle, edge.high) for edge in board.pico.edges if edge.output == output]


def dark_after(board: Board, cycle: int) -> int:
    """Cycles from there to the last change of a light."""
    assert not any(board.pico.levels().values())
    return max((edge.cycle for edge in board.pico.edges if edge.cycle > cycle), default=cycle) - cycle


def test_it_is_made_of_pulses_that_are_short_and_far_apart(board: Board) -> None:
    for output in ("light0", "light3"):
        ups, downs = ([cycle for cycle, high in edges(board, output) if high is level] for level in (True, False))
        widths_ns = {(down - up) * CYCLE_NS for up, down in zip(ups, downs, strict=False)}
        periods_ns = {(b - a) * CYCLE_NS for a, b in itertools.pairwise(ups)}
        assert len(ups) > 100
        assert max(widths_ns) <= LIMIT["MAX_WIDTH_NS"]
        assert max(widths_ns) / min(periods_ns) <= LIMIT["MAX_LIGHT_DUTY_PPM"] / 1e6
        assert max(periods_ns) < 50_000, "above 20 kHz, for every exposure of a millisecond the same"
    assert not edges(board, "light1")
    assert not edges(board, "camera0")
    assert board.pico.set_points_ma() == (500, 0, 0, 100)
    board.ask(Command.OFF)


STOPS: dict[str, tuple[Callable[[Board], None], State, Fault]] = {
    "interlock": (lambda board: board.pico.set_interlock(False), State.FAULT, Fault.INTERLOCK),
    "estop": (lambda board: board.pico.set_estop(False), State.FAULT, Fault.ESTOP),
    "abort byte": (lambda board: board.pico.feed(ABORT_BYTE[0]), State.SAFE, Fault(0)),
}


@pytest.mark.parametrize("into_pulse_cycles", [1, 100])
@pytest.mark.parametrize("stop", STOPS)
def test_every_stop_ends_it_within_a_microsecond(board: Board, stop: str, into_pulse_cycles: int) -> None:
    act, state, faults = STOPS[stop]
    stopped: list[int] = []

    def now() -> None:
        stopped.append(board.pico.cycle)
        act(board)

    board.when("light0", True, into_pulse_cycles, now)
    board.pico.run_ms(1)
    assert dark_after(board, stopped[0]) * CYCLE_NS < DARK_WITHIN_NS
    status = board.ask(Command.STATUS)
    assert (State(status.number("state")), Fault(status.number("faults"))) == (state, faults)
    assert board.pico.set_points_ma() == (0, 0, 0, 0)


def test_a_hung_processor_ends_it_before_the_watchdog_does(board: Board) -> None:
    board.pico.hang()
    hung = board.pico.cycle
    board.pico.run_ms(LIMIT["LIGHT_SUSTAIN_MS"])
    last = max(edge.cycle for edge in board.pico.edges)
    assert (last - hung) * CYCLE_NS < LIMIT["LIGHT_SUSTAIN_MS"] * 1e6
    assert board.pico.watchdog_resets == []
    board.pico.edges.clear()
    board.pico.run_ms(200 + BOOT_MS)
    assert len(board.pico.watchdog_resets) == 1
    assert board.pico.edges == []
    assert Fault(board.ask(Command.STATUS).number("faults")) is Fault.WATCHDOG


def test_it_ends_when_its_time_is_over() -> None:
    board = Board()
    board.pico.run_ms(READY_MS)
    board.pico.edges.clear()
    board.ask(Command.LIGHT, 10, 0, 0, 10, 0)
    board.pico.run_ms(30)
    lit = edges(board, "light2")
    assert 8e6 < (lit[-1][0] - lit[0][0]) * CYCLE_NS < 13e6
    assert board.ask(Command.BEAT).number("state") == State.SAFE


def test_a_reply_does_not_let_it_flicker(board: Board) -> None:
    """The longest one takes two or three words of light to send."""
    board.pico.edges.clear()
    board.ask(Command.STATUS)
    board.ask(Command.ID)
    ups = [cycle for cycle, high in edges(board, "light0") if high]
    assert max(b - a for a, b in itertools.pairwise(ups)) * CYCLE_NS < 50_000
    board.ask(Command.OFF)


def test_it_never_meets_the_set_points_of_pulses() -> None:
    board = Board()
    board.configure([PAPER, None, None, None])
    board.pico.run_ms(READY_MS)
    board.arm(1)
    assert board.pico.set_points_ma() == (20_000, 0, 0, 0)
    assert board.ask(Command.LIGHT, 1000, 100, 0, 0, 0).error is ErrorNumber.NOT_SAFE
    board.ask(Command.OFF)
    assert board.ask(Command.LIGHT, 1000, 100, 0, 0, 0).error is ErrorNumber.EARLY
    board.pico.run_ms(READY_MS)
    board.pico.edges.clear()
    board.ask(Command.LIGHT, 1000, 100, 0, 0, 0)
    board.pico.run_ms(1)
    assert edges(board, "light0")
    assert board.pico.set_points_ma() == (100, 0, 0, 0)
    assert board.ask(Command.ARM, 1, 0, 0).error is ErrorNumber.NOT_SAFE
    board.ask(Command.OFF)


@pytest.mark.parametrize("current_ma", [LIMIT["MAX_LIGHT_MA"] + 1, 30_000])
def test_a_current_of_pulses_is_refused(current_ma: int) -> None:
    board = Board()
    board.pico.run_ms(READY_MS)
    assert board.ask(Command.LIGHT, 1000, current_ma, 0, 0, 0).error is ErrorNumber.LIGHT
    board.pico.run_ms(PERIOD_MS)
    assert board.pico.edges == []


def test_a_converter_that_does_not_read_back_leaves_it_dark() -> None:
    board = Board()
    board.pico.run_ms(READY_MS)
    board.pico.converter.connected = False
    board.pico.edges.clear()
    assert board.ask(Command.LIGHT, 1000, 100, 0, 0, 0).error is ErrorNumber.HARDWARE
    board.pico.run_ms(PERIOD_MS)
    assert board.pico.edges == []
