"""A crystal that is slow, fast or stands still, as the real image finds it."""

from collections.abc import Iterator

import pytest

from daq.drivers.pulse_protocol import Command, ErrorNumber, Fault, Source, State
from daq.simulation.pico.firmware_build import ImageKind
from daq.simulation.pico.rp2040_emulator import CYCLES_PER_MS, EmulatedPico
from tests.support.rp2040_board import BOOT_MS, PAPER, PERIOD_MS, Board, image

LOOK_MS = 25
"""Two looks, one of which may have begun before."""


@pytest.fixture
def board() -> Iterator[Board]:
    """Armed by the timer, so that it fires without anybody's help."""
    board = Board()
    board.configure([PAPER] * 4)
    board.pico.run_ms(2 * PERIOD_MS)
    board.arm(1000, Source.TIMER, 10_000)
    yield board
    assert not any(board.pico.levels().values())


def lights_within(board: Board, time_ms: float) -> int:
    board.pico.edges.clear()
    board.pico.run_ms(time_ms)
    return sum(edge.output.startswith("light") for edge in board.pico.edges)


@pytest.mark.parametrize("factor", [0.7, 1.4])
def test_a_crystal_that_changes_while_armed_trips_and_stays_a_fault(board: Board, factor: float) -> None:
    assert lights_within(board, LOOK_MS) > 0
    board.pico.crystal.change_speed(factor)
    board.pico.run_ms(LOOK_MS)
    assert lights_within(board, 100) == 0
    assert board.pico.set_points_ma() == (0, 0, 0, 0)
    board.pico.crystal.change_speed(1)
    board.pico.run_ms(2 * LOOK_MS)
    status = board.ask(Command.STATUS)
    assert (State(status.number("state")), Fault(status.number("faults"))) == (State.FAULT, Fault.CLOCK)
    assert board.ask(Command.CLEAR).error is ErrorNumber.HARDWARE
    board.pico.power_up()
    board.pico.run_ms(BOOT_MS)
    assert board.ask(Command.STATUS).number("faults") == 0


def test_a_pll_that_has_lost_its_lock_is_a_fault() -> None:
    """Crystal and ring oscillator agree; the processor, from which all pulses have their width, agrees with neither."""
    for factor in (0.7, 1.4):
        board = Board()
        board.pico.crystal.change_pll(factor)
        board.pico.run_ms(LOOK_MS)
        board.pico.crystal.change_pll(1)
        assert Fault(board.ask(Command.STATUS).number("faults")) == Fault.CLOCK


def test_32_bits_of_microseconds_wrap_without_a_fault() -> None:
    pico = EmulatedPico(image(ImageKind.CONVERTER).read_bytes())
    pico.crystal.start_timer_at(2**32 - 60_000)
    board = Board.of(pico)
    pico.run_ms(BOOT_MS)
    board.configure([PAPER])
    board.arm(1000, Source.TIMER, 10_000)
    pico.run_ms(60 - pico.cycle / CYCLES_PER_MS)
    assert lights_within(board, LOOK_MS) >= 2 * 4, "two shots of two pulses"
    assert board.ask(Command.STATUS).number("faults") == 0


@pytest.mark.parametrize("factor", [0.85, 1.15])
def test_a_ring_oscillator_that_drifts_is_no_fault(board: Board, factor: float) -> None:
    board.pico.crystal.change_speed(factor)
    assert lights_within(board, 10 * LOOK_MS) > 0
    assert board.ask(Command.STATUS).number("faults") == 0


def test_a_crystal_that_stands_still_ends_all_light(board: Board) -> None:
    """Neither heartbeat nor watchdog would: both have their time from it. Set-points may stay: a wait for their bus has
    no end without a timer, and nothing but the interrupt goes on."""
    board.pico.crystal.stop()
    board.pico.run_ms(LOOK_MS)
    assert lights_within(board, 100) == 0
    assert board.pico.watchdog_resets == []


@pytest.mark.parametrize("hung", [False, True])
def test_a_trigger_input_finds_nothing_to_start_once_the_crystal_stands_still(board: Board, hung: bool) -> None:
    """Also while the main loop waits for a timer that stands still too."""
    board.ask(Command.OFF)
    board.arm(10, Source.EXTERNAL)
    board.pico.run_ms(BOOT_MS)
    board.pico.crystal.stop()
    if hung:
        board.pico.hang(deaf=False)
    board.pico.run_ms(LOOK_MS)
    board.pico.edges.clear()
    for high in (True, False, True):
        board.pico.set_trigger_pin(high)
        board.pico.run_ms(1)
    assert not any(edge.output.startswith("light") for edge in board.pico.edges)


@pytest.mark.parametrize("factor", [0.5, 4])
def test_a_wrong_crystal_is_a_fault_from_the_start(factor: float) -> None:
    """As far as the ring oscillator can tell, which may be anywhere from 1.8 to 12 MHz."""
    pico = EmulatedPico(image(ImageKind.CONVERTER).read_bytes())
    pico.crystal.change_speed(factor)
    board = Board.of(pico)
    pico.run_ms(BOOT_MS)
    assert Fault(board.ask(Command.STATUS).number("faults")) == Fault.CLOCK
