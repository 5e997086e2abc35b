"""What starts a shot of the real image: the trigger pin without the processor, the timer, FIRE; and what does not."""

import random
from collections.abc import Iterator
from dataclasses import replace

import pytest

from daq.drivers.pulse_framing import ABORT_BYTE
from daq.drivers.pulse_protocol import HEARTBEAT_MS, Command, ErrorNumber, Fault, Source, State
from daq.simulation.pico.rp2040_emulator import CYCLE_NS, CYCLES_PER_MS, START_CYCLES
from tests.support.rp2040_board import PAPER, PERIOD_MS, Board, Channel

FIRST_SHOT_MS = 20
EDGES_OF_A_SHOT = 6
TIMER_JITTER_US = 200
"""A shot that is due while a line is carried out waits for its end: at worst SHOT, 183 us."""
SHOTS_WHILE_BUSY = 3


@pytest.fixture(scope="module")
def shared() -> Board:
    board = Board()
    board.pico.run_ms(FIRST_SHOT_MS)
    return board


@pytest.fixture
def board(shared: Board) -> Iterator[Board]:
    shared.pico.set_trigger_pin(False)
    shared.configure([PAPER, None, None, None])
    yield shared
    shared.ask(Command.OFF)
    shared.pico.set_interlock(True)
    shared.pico.set_estop(True)
    shared.pico.run_ms(2 * PERIOD_MS)
    shared.ask(Command.CLEAR)
    assert not any(shared.pico.levels().values())


def counted(board: Board, before: dict[str, int]) -> dict[str, int]:
    return {name: count - before[name] for name, count in counters(board).items()}


def counters(board: Board) -> dict[str, int]:
    status = board.ask(Command.STATUS)
    return {name: status.number(name) for name in ("requested", "fired", "suppressed", "early", "cameras")}


def edge(board: Board, high_ms: float = 0.05) -> int:
    """A pulse on the trigger pin; the cycle of its rise."""
    rise = board.pico.cycle
    board.pico.set_trigger_pin(True)
    board.pico.run_ms(high_ms)
    board.pico.set_trigger_pin(False)
    return rise


def rises(board: Board, output: str) -> list[int]:
    return [e.cycle for e in board.pico.edges if e.output == output and e.high]


def outputs_moved(board: Board) -> int:
    return sum(e.output != "trigger" for e in board.pico.edges)


def test_an_external_edge_fires_without_the_processor_and_without_jitter(board: Board) -> None:
    board.arm(20, Source.EXTERNAL)
    chance = random.Random(1)
    for _ in range(20):
        board.pico.run_ms(PERIOD_MS + 1)
        board.pico.run(board.pico.cycle + chance.randrange(2000))
        board.pico.edges.clear()
        rise = edge(board)
        assert [cycle - rise for cycle in rises(board, "camera0")] == [START_CYCLES]
        assert board.waveform() == sorted(PAPER.edges(0))
    board.pico.run_ms(PERIOD_MS)
    board.pico.edges.clear()
    edge(board)
    assert outputs_moved(board) == 0, "the budget is spent"


def test_a_hung_processor_gives_the_permitted_shot_and_no_other() -> None:
    board = Board()
    board.configure([PAPER, None, None, None])
    board.pico.run_ms(FIRST_SHOT_MS)
    board.arm(20, Source.EXTERNAL)
    board.pico.run_ms(5)
    board.pico.edges.clear()
    board.pico.hang()
    for _ in range(5):
        edge(board)
        board.pico.run_ms(PERIOD_MS)
    assert outputs_moved(board) == EDGES_OF_A_SHOT


def test_a_line_that_is_high_when_it_is_armed_fires_at_its_next_rise(board: Board) -> None:
    board.pico.set_trigger_pin(True)
    board.arm(2, Source.EXTERNAL)
    board.pico.run_ms(3 * PERIOD_MS)
    assert not rises(board, "light0")
    board.pico.set_trigger_pin(False)
    board.pico.run_ms(1)
    assert not rises(board, "light0")
    board.pico.edges.clear()
    edge(board)
    assert outputs_moved(board) == EDGES_OF_A_SHOT


def test_early_edges_are_ignored_counted_and_not_queued(board: Board) -> None:
    before = counters(board)
    board.arm(5, Source.EXTERNAL)
    board.pico.run_ms(5)
    board.pico.edges.clear()
    for _ in range(4):
        edge(board)
        board.pico.run_ms(1)
    board.pico.run_ms(3 * PERIOD_MS)
    assert outputs_moved(board) == EDGES_OF_A_SHOT
    assert counted(board, before) == {"requested": 4, "fired": 1, "suppressed": 3, "early": 3, "cameras": 1}


def test_no_edge_a_little_more_than_a_period_after_another_is_lost() -> None:
    """While the host asks without pause: replies that take longer than a period to send."""
    board = Board()
    board.configure([PAPER, None, None, None])
    board.pico.run_ms(FIRST_SHOT_MS)
    board.arm(SHOTS_WHILE_BUSY, Source.EXTERNAL)
    board.pico.run_ms(5)
    before = counters(board)
    board.pico.pace_serial_line()
    for _ in range(SHOTS_WHILE_BUSY):
        board.send(Command.STATUS)
        edge(board)
        board.pico.run_ms(PERIOD_MS + 0.2 - 0.05)
    board.pico.run_ms(SHOTS_WHILE_BUSY * 12)
    shots = SHOTS_WHILE_BUSY
    assert board.pico.sent.count(b"OK state=") == shots + 1
    assert counted(board, before) == {"requested": shots, "fired": shots, "suppressed": 0, "early": 0, "cameras": shots}


@pytest.mark.parametrize("moment", range(0, 400, 20))
def test_an_edge_while_the_words_are_pushed_fires_all_channels_or_none(moment: int) -> None:
    """The line is handed to the pin by one write: whenever the edge comes, no machine is left behind."""
    board = permitted_soon()
    at = board.pico.cycle + moment
    board.pico.at(at, lambda: board.pico.set_trigger_pin(True))
    board.pico.edges.clear()
    board.pico.run_ms(0.2)
    starts = {tuple(rises(board, output)[:1]) for output in ("camera0", "camera3", "light0", "light3")}
    assert len(starts) == 1, starts
    board.pico.set_trigger_pin(False)
    board.pico.run_ms(0.2)
    assert not any(board.pico.levels().values())


_BUSY: list[Board] = []


def permitted_soon() -> Board:
    """A board whose processor is about to permit the next external shot."""
    if not _BUSY:
        board = Board()
        now = Channel(0, 0, 1000, 6400, 1000).straddling()
        board.configure([now, None, None, now])
        board.pico.run_ms(FIRST_SHOT_MS)
        board.arm(1_000_000, Source.EXTERNAL)
        _BUSY.append(board)
    (board,) = _BUSY
    board.ask(Command.BEAT)
    board.pico.run_ms(2 * PERIOD_MS)
    edge(board)
    opened: list[int] = []
    board.when("trigger", True, 0, lambda: opened.append(board.pico.cycle))
    while not opened:  # the line is forced high while the words are pushed
        board.pico.run(board.pico.cycle + 20)
    return board


@pytest.mark.parametrize("stop", ["interlock", "estop"])
def test_both_stops_take_the_permission_away(board: Board, stop: str) -> None:
    board.arm(5, Source.EXTERNAL)
    board.pico.run_ms(5)
    board.pico.edges.clear()
    (board.pico.set_interlock if stop == "interlock" else board.pico.set_estop)(False)
    board.pico.run(board.pico.cycle + 60)
    edge(board)
    board.pico.run_ms(1)
    assert outputs_moved(board) == 0
    status = board.ask(Command.STATUS)
    assert Fault(status.number("faults")) is Fault[stop.upper()]
    assert (status.number("requested"), status.number("fired")) == (
        status.number("fired") + status.number("suppressed"),
        status.number("fired"),
    )


def test_a_silent_host_ends_external_triggers(board: Board) -> None:
    board.arm(5, Source.EXTERNAL)
    board.pico.run_ms(HEARTBEAT_MS + 20)
    board.pico.edges.clear()
    edge(board)
    assert outputs_moved(board) == 0
    assert Fault(board.ask(Command.STATUS).number("faults")) is Fault.HEARTBEAT


def test_the_timer_keeps_its_period(board: Board) -> None:
    """In the processor's time, so with its jitter; the host asks all the time."""
    board.arm(20, Source.TIMER, 12_345)
    armed = board.pico.cycle
    board.pico.edges.clear()
    for _ in range(12):
        board.ask(Command.STATUS)
        board.pico.run_ms(5)
    shots = rises(board, "camera0")
    assert len(shots) >= 5
    period = 12_345 * CYCLES_PER_MS // 1000
    late_us = [(cycle - armed - (i + 1) * period) * CYCLE_NS / 1000 for i, cycle in enumerate(shots)]
    assert max(late_us) - min(late_us) < TIMER_JITTER_US
    status = board.ask(Command.STATUS)
    assert State(status.number("state")) is State.ARMED
    assert board.ask(Command.FIRE).error is ErrorNumber.OTHER_SOURCE


def ask_to_fire(board: Board) -> int:
    """Send FIRE; the cycle at which its last byte has arrived."""
    board.pico.run_ms(2 * PERIOD_MS)
    board.arm(1000)
    board.pico.edges.clear()
    board.send(Command.FIRE)
    board.pico.run_until_received()
    return board.pico.cycle


def test_an_abort_between_the_words_and_the_start_is_no_shot(board: Board) -> None:
    """Whatever is counted has happened, and the other way round."""
    asked = ask_to_fire(board)
    board.pico.run_ms(1)
    fires_after = rises(board, "trigger")[0] - asked
    board.ask(Command.OFF)
    given = []
    for early_cycles in range(-160, 240, 40):
        before = counters(board)
        asked = ask_to_fire(board)
        board.pico.run(asked + fires_after - early_cycles)
        board.pico.feed(ABORT_BYTE[0])
        board.pico.run_ms(3)  # the reply waits until the converter confirms its zeros
        shot = counted(board, before)
        assert shot["fired"] == len(rises(board, "trigger"))
        assert shot["cameras"] == len(rises(board, "camera0")) <= shot["fired"]
        assert (shot["requested"], shot["suppressed"]) == (1, 1 - shot["fired"])
        given.append(shot["fired"])
    assert set(given) == {0, 1}, given


def test_one_pulse_alone(board: Board) -> None:
    single = replace(PAPER, b_start_ns=0, b_width_ns=0, frame_b_open_ns=0)
    board.configure([single, PAPER, None, None])
    board.arm(1)
    waveform = board.shoot()
    assert [edge for edge in waveform if edge[1].endswith("0")] == [
        (0, "camera0", True),
        (10_000, "camera0", False),
        (20_000, "light0", True),
        (21_000, "light0", False),
    ]
    assert [edge for edge in waveform if edge[1].endswith("1")] == sorted(PAPER.edges(1))


def test_the_newest_shot_is_told_in_ticks(board: Board) -> None:
    board.configure([replace(PAPER, a_start_ns=20_003), None, None, None])
    assert board.ask(Command.SHOT, 3).error is ErrorNumber.NO_SHOT
    board.arm(1)
    waveform = board.shoot()
    shot = board.ask(Command.SHOT, 0)
    names = ("camera_ticks", "a_start_ticks", "b_start_ticks")
    told = sorted(shot.number(name) * CYCLE_NS for name in names)
    assert told == [at_ns for at_ns, _, high in waveform if high]
    assert shot.number("fired") == board.ask(Command.STATUS).number("fired")
