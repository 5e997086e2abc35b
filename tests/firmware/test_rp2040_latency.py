"""The worst moments for a stop: while a trigger edge is served, while the processor masks interrupts, while it counts.

The emulator leaves out entering an interrupt, 15 cycles of 8 ns, and the input synchronisers.
"""

from collections.abc import Iterator
from functools import partial

import pytest

from daq.drivers.pulse_framing import ABORT_BYTE
from daq.drivers.pulse_protocol import Command, Source
from daq.simulation.pico.rp2040_chip import TRIGGER
from daq.simulation.pico.rp2040_emulator import CYCLE_NS
from tests.support.rp2040_board import Board, Channel

LONGEST = Channel(0, 0, 2000, 3000, 2000).straddling()
PERIOD_MS = 20
"""Of that much light."""
UNDISTURBED_NS = 450
WITHIN_NS = {"interlock": 950, "abort": 1800}
"""Measured: the interlock 848 ns beside a trigger edge, 736 ns where the processor is about to sleep; the abort byte
1136 ns beside a trigger edge, 976 ns while the clocks are compared, 1352 ns with both; all at once are 1.8 us."""
SYSTICK_VALUE = 0xE000_E018
LEAD_CYCLES = 2000
AFTER_TRIGGER = range(300, 1500, 2)
"""Cycles in which the main loop ends its turn and goes to sleep."""


@pytest.fixture(scope="module")
def shared() -> Board:
    return Board()


@pytest.fixture
def board(shared: Board) -> Iterator[Board]:
    yield shared
    shared.ask_in_bursts(Command.OFF)


def prepare(board: Board, channel: Channel, source: Source) -> None:
    """Armed, with all that was before it over."""
    board.pico.set_interlock(True)
    board.pico.set_trigger_pin(False)
    board.ask_in_bursts(Command.OFF)
    board.ask_in_bursts(Command.CLEAR)
    board.configure([channel] * 4)
    board.pico.run_ms(PERIOD_MS)
    board.arm(5, source, PERIOD_MS * 1000 if source is Source.TIMER else 0)
    board.pico.edges.clear()


def stop(board: Board, how: str, stopped: list[int]) -> None:
    stopped.append(board.pico.cycle)
    if how == "abort":
        board.pico.feed(ABORT_BYTE[0])
    else:
        board.pico.set_interlock(False)


def dark_after_ns(board: Board, stopped: int) -> int:
    lights = [edge for edge in board.pico.edges if edge.output.startswith("light")]
    assert lights, "it was lit"
    assert not any(edge.high and edge.cycle > stopped for edge in lights), "pulse B is not given"
    return (max(edge.cycle for edge in lights) - stopped) * CYCLE_NS


def stopped_after_an_edge(board: Board, how: str, after_cycles: int, trigger_in_cycles: int = LEAD_CYCLES) -> int:
    """A trigger edge starts a shot, and some cycles later it is stopped; the time until it is dark, in ns."""
    stopped: list[int] = []
    rise = board.pico.cycle + trigger_in_cycles
    board.pico.at(rise, lambda: board.pico.set_trigger_pin(True))
    board.pico.at(rise + after_cycles, lambda: stop(board, how, stopped))
    board.pico.run(rise + LEAD_CYCLES)
    return dark_after_ns(board, stopped[0])


@pytest.mark.parametrize("how", WITHIN_NS)
def test_a_stop_that_comes_while_a_trigger_edge_is_served_does_not_wait_long(board: Board, how: str) -> None:
    late_ns = []
    for after_cycles in range(4, 80, 8):
        prepare(board, LONGEST, Source.EXTERNAL)
        late_ns.append(stopped_after_an_edge(board, how, after_cycles))
    assert UNDISTURBED_NS < max(late_ns) < WITHIN_NS[how], late_ns


@pytest.mark.parametrize("how", WITHIN_NS)
def test_a_stop_that_comes_while_the_clocks_are_compared_does_not_wait_long(board: Board, how: str) -> None:
    late_ns = []
    for moment in range(0, 64, 8):
        prepare(board, LONGEST, Source.EXTERNAL)
        counted_cycles = board.pico.read_word(SYSTICK_VALUE)
        late_ns.append(stopped_after_an_edge(board, how, 130, counted_cycles - 130 + moment))
    assert max(late_ns) < WITHIN_NS[how], late_ns


def unmasked_until(board: Board) -> int:
    """Cycles after a shot of the timer, until interrupts are masked for the sleep that follows."""
    unmasked: list[int] = []

    def look(after_cycles: int) -> None:
        if not board.pico.interrupts_masked:
            unmasked.append(after_cycles)

    def watch() -> None:
        for cycles in AFTER_TRIGGER:
            board.pico.at(board.pico.cycle + cycles, partial(look, cycles))

    prepare(board, LONGEST, Source.TIMER)
    board.when(TRIGGER, True, 0, watch)
    board.pico.run_ms(2 * PERIOD_MS)
    return unmasked[-1]


def stopped_after_the_timer(board: Board, channel: Channel, after_cycles: int) -> int:
    """As `stopped_after_an_edge`."""
    stopped: list[int] = []
    prepare(board, channel, Source.TIMER)
    board.when(TRIGGER, True, after_cycles, lambda: stop(board, "interlock", stopped))
    board.pico.run_ms(2 * PERIOD_MS)
    return dark_after_ns(board, stopped[0])


def test_a_stop_that_comes_while_the_processor_is_about_to_sleep_does_not_wait_long(board: Board) -> None:
    """Masked, so that nothing slips in between look and sleep."""
    last = unmasked_until(board)
    start_ns = (last - 25) * CYCLE_NS  # so that it does not end by itself before it has to be dark
    channel = Channel(0, start_ns, 2000, start_ns + 3000, 2000).straddling()
    late_ns = [stopped_after_the_timer(board, channel, after) for after in range(last - 8, last + 56, 4)]
    assert UNDISTURBED_NS < max(late_ns) < WITHIN_NS["interlock"], late_ns
