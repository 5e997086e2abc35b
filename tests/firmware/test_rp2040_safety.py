"""How the real image gets dark: abort, interlock, silent host, hung processor, overflowing stack; and stays dark."""

import itertools
from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest

from daq.drivers.pulse_framing import ABORT_BYTE
from daq.drivers.pulse_protocol import (
    HEARTBEAT_MS,
    Command,
    ErrorNumber,
    Fault,
    Request,
    Source,
    State,
    decode_reply,
    encode_request,
)
from daq.simulation.pico.rp2040_chip import PIN_CAMERA, PIN_ESTOP, PIN_INTERLOCK, PIN_LIGHT, PIN_TRIGGER
from daq.simulation.pico.rp2040_emulator import CYCLE_NS, CYCLES_PER_MS
from tests.support.rp2040_board import BOOT_MS, PAPER, PERIOD_MS, Board, state_and_faults

WATCHDOG_MS = 200
DARK_WITHIN_NS = 450
"""Measured: 368 ns for the last of four channels, 408 ns inside the serial interrupt. The emulator leaves
out entering the interrupt, about 20 cycles."""
CUT_WITHIN_NS = 800
"""The camera triggers too; measured: 640 ns. What is only noticed after arming is cut in 2200 ns."""
NVIC_ENABLE, NVIC_PEND = 0xE000_E100, 0xE000_E200
WATCHDOG_CTRL, WATCHDOG_LOAD, WATCHDOG_TICKS_PER_MS = 0x4005_8000, 0x4005_8004, 2000
PSM_WDSEL, UART_LCR_H = 0x4001_0008, 0x4003_402C
TIMER_DBGPAUSE, BROWN_OUT = 0x4005_402C, 0x4006_4004
UNEXPECTED = 1 << 3
"""The interrupt of an alarm that nobody uses."""
RAM, STACK_SIZE, STACK_BOUND = 0x2000_0000, 896, 780
PAINT = 0xA5A5_A5A5
ABORT_WITHIN_NS = 800
MASKED_NS = 350
"""For 42 cycles at most, on the way to sleep."""
PIO_BLOCKS = (0x5020_0000, 0x5030_0000)
FIRST_FIFO = 0x10
OUTPUT_CTRL = [0x4001_4004 + 8 * pin for pin in range(PIN_LIGHT, PIN_LIGHT + 8)]
FORCED_LOW = 2
ARMING_CYCLES, LOOK_CYCLES = 4 * CYCLES_PER_MS, 8
LOADING_CYCLES = 500
"""The last instructions of loading, which an interrupt waits for, take not much more."""
LONG = replace(PAPER, camera_ns=15_000, a_width_ns=2000, b_width_ns=2000, frame_a_close_ns=8000, frame_b_open_ns=9000)
"""The longest pulses, so that no end of a pulse is taken for the interlock's; the camera triggers overlap them."""


@pytest.fixture
def board() -> Iterator[Board]:
    """An armed board; whatever is done to it, no output stays high and no shot is left over."""
    board = Board()
    board.configure([LONG] * 4)
    board.arm(100)
    board.pico.edges.clear()
    yield board
    board.pico.run_ms(PERIOD_MS)
    assert not any(board.pico.levels().values())
    counters = board.ask(Command.STATUS)
    assert counters.number("requested") == counters.number("fired") + counters.number("suppressed")


def fire(board: Board) -> None:
    assert board.ask(Command.FIRE).error is None


def lit_after(board: Board, cycle: int) -> list[int]:
    """Cycles after that one, at which a light rose."""
    return [e.cycle for e in board.pico.edges if e.output.startswith("light") and e.high and e.cycle > cycle]


def dark_at(board: Board) -> int:
    """Cycle of the last falling edge of a light."""
    return max(edge.cycle for edge in board.pico.edges if edge.output.startswith("light") and not edge.high)


@pytest.mark.parametrize("into_pulse_cycles", [1, 30, 90, 150])
def test_the_interlock_ends_a_pulse_in_less_than_a_microsecond_and_latches(
    board: Board, into_pulse_cycles: int
) -> None:
    opened: list[int] = []

    def open_door() -> None:
        opened.append(board.pico.cycle)
        board.pico.set_interlock(False)

    board.when("light0", True, into_pulse_cycles, open_door)
    fire(board)
    board.pico.run_ms(1)
    assert (dark_at(board) - opened[0]) * CYCLE_NS < DARK_WITHIN_NS + MASKED_NS
    assert not lit_after(board, opened[0]), "pulse B is not given"
    assert not any(board.pico.levels().values()), "neither are the camera triggers, which were high"
    assert [board.pico.read_word(block) for block in PIO_BLOCKS] == [0, 0], "and the state machines stand still"
    assert board.pico.set_points_ma() == (0, 0, 0, 0)
    assert state_and_faults(board) == (State.FAULT, Fault.INTERLOCK)
    assert board.ask(Command.CLEAR).error is ErrorNumber.INTERLOCK_OPEN
    board.pico.set_interlock(True)
    assert board.ask(Command.FIRE).error is ErrorNumber.FAULT_LATCHED
    assert board.ask(Command.CLEAR).error is None
    assert board.ask(Command.FIRE).error is ErrorNumber.NOT_ARMED


def test_an_interlock_that_bounces_for_a_moment_trips_too(board: Board) -> None:
    board.pico.set_interlock(False)
    board.pico.set_interlock(True)
    board.pico.run_ms(PERIOD_MS)
    assert state_and_faults(board) == (State.FAULT, Fault.INTERLOCK)


def test_the_interlock_is_served_before_the_serial_line(board: Board) -> None:
    """A byte's interrupt is interrupted, wherever it is."""
    late_ns = []
    for delay_cycles in range(0, 60, 4):
        opened = shoot_into_open_interlock(board, delay_cycles)
        late_ns.append((dark_at(board) - opened) * CYCLE_NS)
        board.pico.set_interlock(True)
        assert board.ask_in_bursts(Command.CLEAR).error is None
        board.pico.run_ms(2 * PERIOD_MS)
        board.arm(100)
    assert max(late_ns) < DARK_WITHIN_NS + MASKED_NS, late_ns


def shoot_into_open_interlock(board: Board, delay_cycles: int) -> int:
    """A byte arrives in mid-pulse, and some cycles later the interlock opens; the cycle of that."""
    opened: list[int] = []

    def open_door() -> None:
        opened.append(board.pico.cycle)
        board.pico.set_interlock(False)

    def receive_byte() -> None:
        board.pico.feed(ord("x"))
        board.pico.at(board.pico.cycle + delay_cycles, open_door)

    board.pico.edges.clear()
    board.when("light0", True, 10, receive_byte)
    fire(board)
    board.pico.run_ms(1)
    board.say(b"\n")
    return opened[0]


def is_live(board: Board) -> bool:
    return any(board.pico.read_word(ctrl) >> 8 & 3 != FORCED_LOW for ctrl in OUTPUT_CTRL)


def can_light(board: Board) -> bool:
    return is_live(board) and any(board.pico.set_points_ma())


def is_live_unmasked(board: Board) -> bool:
    """Although the interrupt of the interlock is not kept waiting."""
    return not board.pico.interrupts_masked and is_live(board)


def while_arming(
    board: Board, watched_cycles: range, opened_after_cycles: int, seen: Callable[[Board], bool] = is_live_unmasked
) -> list[int]:
    """Of these cycles after the last byte of ARM, those at which it is so. The interlock opens."""
    line = encode_request(Request(60_000, Command.ARM, (1, 0, 0)))
    board.pico.receive(line[:-1])
    board.pico.run_ms(PERIOD_MS)
    start = board.pico.cycle
    found: list[int] = []

    def look() -> None:
        if seen(board):
            found.append(board.pico.cycle - start)

    for cycles in watched_cycles:
        board.pico.at(start + cycles, look)
    board.pico.at(start + opened_after_cycles, lambda: board.pico.set_interlock(False))
    board.pico.feed(line[-1])
    board.pico.run(start + watched_cycles.stop)
    board.pico.run_ms(PERIOD_MS)
    status = board.ask_in_bursts(Command.STATUS)
    assert (status.number("state"), status.number("faults")) == (State.FAULT, Fault.INTERLOCK), "ARM was accepted"
    assert board.pico.set_points_ma() == (0, 0, 0, 0)
    board.pico.set_interlock(True)
    board.ask_in_bursts(Command.OFF)
    assert board.ask_in_bursts(Command.CLEAR).error is None
    return found


def cycles_until_live(board: Board) -> int:
    """Of an arming that nothing disturbs: from then on there can be light, until the interlock opens."""
    board.ask(Command.OFF)
    lit = while_arming(board, range(0, ARMING_CYCLES, LOADING_CYCLES), ARMING_CYCLES, can_light)
    assert len(lit) == len(range(lit[0], ARMING_CYCLES, LOADING_CYCLES))
    return lit[0]


def test_an_interlock_that_opens_at_any_moment_of_arming_leaves_the_outputs_cut(board: Board) -> None:
    """Whether before, while or after the train is loaded into the hardware."""
    given = cycles_until_live(board)
    early = range(given // 6, given, given // 6)
    late = range(given - 4 * LOADING_CYCLES, given + LOADING_CYCLES, LOADING_CYCLES // 2)
    for moment in (*early, *late):
        watched = range(given - LOADING_CYCLES, given + 2 * LOADING_CYCLES, LOOK_CYCLES)
        live = [cycle for cycle in while_arming(board, watched, moment) if cycle > moment]
        assert len(live) * LOOK_CYCLES * CYCLE_NS < CUT_WITHIN_NS, moment


def test_an_interlock_that_opens_just_before_interrupts_are_masked_cuts_the_outputs(board: Board) -> None:
    """Whether the outputs are still wanted is asked with interrupts masked; in no cycle before can it be too late."""
    given = cycles_until_live(board)
    live = while_arming(board, range(given - LOADING_CYCLES, given + 1), ARMING_CYCLES, can_light)[0]
    before_live = range(live - 6 * LOADING_CYCLES, live)
    masked = while_arming(board, before_live, ARMING_CYCLES, lambda board: not board.pico.interrupts_masked)[-1]
    for moment in range(masked - 16, masked + 2):
        watched = range(given - LOADING_CYCLES, given + 2 * LOADING_CYCLES, LOOK_CYCLES)
        assert len(while_arming(board, watched, moment)) * LOOK_CYCLES * CYCLE_NS < CUT_WITHIN_NS, moment


def test_the_pads_of_all_outputs_pull_down(board: Board) -> None:
    for pin in (
        *range(PIN_LIGHT, PIN_LIGHT + 4),
        *range(PIN_CAMERA, PIN_CAMERA + 4),
        PIN_INTERLOCK,
        PIN_ESTOP,
        PIN_TRIGGER,
    ):
        pad = board.pico.read_word(0x4001_C004 + 4 * pin)
        assert (pad >> 2 & 1, pad >> 3 & 1) == (1, 0), pin


def test_the_abort_byte_disarms_from_inside_a_line(board: Board) -> None:
    torn = board.say(b">9 FI" + ABORT_BYTE + b"\n")
    assert decode_reply(torn).error is ErrorNumber.CRC
    assert state_and_faults(board) == (State.SAFE, Fault(0))
    assert board.pico.set_points_ma() == (0, 0, 0, 0)
    assert board.ask(Command.FIRE).error is ErrorNumber.NOT_ARMED


def test_the_abort_byte_ends_a_pulse_in_less_than_a_microsecond(board: Board) -> None:
    arrived: list[int] = []

    def abort() -> None:
        arrived.append(board.pico.cycle)
        board.pico.feed(ABORT_BYTE[0])

    board.when("light2", True, 10, abort)
    fire(board)
    board.pico.run_ms(1)
    assert (dark_at(board) - arrived[0]) * CYCLE_NS < ABORT_WITHIN_NS
    assert not lit_after(board, arrived[0])


def test_a_silent_host_ends_in_a_latched_fault(board: Board) -> None:
    board.pico.run_ms(HEARTBEAT_MS - 50)
    assert board.pico.set_points_ma() != (0, 0, 0, 0)
    board.pico.run_ms(100)
    assert board.pico.set_points_ma() == (0, 0, 0, 0)
    assert state_and_faults(board) == (State.FAULT, Fault.HEARTBEAT)
    assert board.ask(Command.FIRE).error is ErrorNumber.FAULT_LATCHED


def test_an_echo_does_not_outlive_the_host(board: Board) -> None:
    """Of the generator's own replies, by a line that gives them back; the timer fires until the heartbeat ends it."""
    board.ask(Command.OFF)
    board.arm(1000, Source.TIMER, period_us=100_000)
    board.send(Command.BEAT)
    for _ in range(HEARTBEAT_MS // 10 + 10):
        board.pico.run_ms(10)
        board.pico.receive(bytes(board.pico.sent))
        board.pico.sent.clear()
    assert board.pico.set_points_ma() == (0, 0, 0, 0)
    assert state_and_faults(board) == (State.FAULT, Fault.HEARTBEAT)


def test_the_trigger_pin_fires_nothing_whatever_its_level(board: Board) -> None:
    board.ask(Command.OFF)
    board.pico.set_trigger_pin(True)
    board.arm(3)
    board.pico.run_ms(PERIOD_MS)
    for high in (False, True, False):
        board.pico.set_trigger_pin(high)
        board.pico.run_ms(1)
    assert board.pico.edges == []
    board.pico.set_trigger_pin(True)
    fired = board.shoot()
    assert len([edge for edge in fired if edge[1] == "light0"]) == 4, "FIRE still gives exactly one shot"


def test_an_early_shot_is_ignored_counted_and_not_queued(board: Board) -> None:
    assert board.ask(Command.FIRE).error is None
    edges_of_a_shot = len(board.pico.edges)
    assert board.ask(Command.FIRE).error is ErrorNumber.EARLY
    board.pico.run_ms(3 * PERIOD_MS)
    assert len(board.pico.edges) == edges_of_a_shot
    status = board.ask(Command.STATUS)
    assert [status.number(name) for name in ("requested", "fired", "suppressed", "early")] == [2, 1, 1, 1]


def test_words_left_in_the_fifos_are_no_part_of_the_next_shot(board: Board) -> None:
    board.ask(Command.OFF)
    for block, machine, word in itertools.product(PIO_BLOCKS, range(4), range(3)):
        board.pico.write_word(block + FIRST_FIFO + 4 * machine, word)
    board.configure([None, PAPER, None, None])
    board.pico.run_ms(PERIOD_MS)
    board.arm(1)
    assert board.shoot() == sorted(PAPER.edges(1))


def test_a_shot_that_was_cut_short_leaves_nothing_behind(board: Board) -> None:
    board.when("light0", True, 10, lambda: board.pico.set_interlock(False))
    fire(board)
    board.pico.run_ms(1)
    board.pico.set_interlock(True)
    board.ask(Command.CLEAR)
    board.configure([None, PAPER, None, None])
    board.pico.run_ms(PERIOD_MS)
    board.arm(1)
    assert board.shoot() == sorted(PAPER.edges(1))


def test_a_hung_processor_is_restarted_dark_and_says_so(board: Board) -> None:
    before = board.ask(Command.ID).boot
    fire(board)
    board.pico.hang()
    board.pico.run_ms(WATCHDOG_MS - 10)
    assert board.pico.watchdog_resets == []
    board.pico.run_ms(20)
    assert len(board.pico.watchdog_resets) == 1
    assert not any(board.pico.levels().values())
    board.pico.run_ms(BOOT_MS)
    reply = board.ask(Command.STATUS)
    assert (State(reply.number("state")), Fault(reply.number("faults"))) == (State.FAULT, Fault.WATCHDOG)
    assert reply.boot == before + 1
    assert board.ask(Command.FIRE).error is ErrorNumber.FAULT_LATCHED


def test_the_watchdog_runs_on_under_a_debugger_and_takes_all_but_the_oscillators(board: Board) -> None:
    control = board.pico.read_word(WATCHDOG_CTRL)
    enabled, paused_by_debugger_or_jtag = control >> 30 & 1, control >> 24 & 7
    assert (enabled, paused_by_debugger_or_jtag) == (1, 0)
    assert board.pico.read_word(PSM_WDSEL) == 0x1FFFF & ~0b11


def test_the_timer_runs_on_under_a_debugger(board: Board) -> None:
    """Or silence of the host would not count while somebody steps through the program."""
    assert board.pico.read_word(TIMER_DBGPAUSE) & 0b110 == 0


def test_a_processor_that_a_debugger_halts_is_restarted_dark(board: Board) -> None:
    """It does nothing any more, while state machines, timer and watchdog go on: one shot at most, and then a reset."""
    board.ask(Command.OFF)
    board.arm(5, Source.EXTERNAL)
    board.pico.run_ms(BOOT_MS)
    board.pico.edges.clear()
    board.pico.hang()
    for _ in range(10):
        board.pico.set_trigger_pin(True)
        board.pico.run_ms(PERIOD_MS)
        board.pico.set_trigger_pin(False)
        board.pico.run_ms(PERIOD_MS)
    board.pico.run_ms(PERIOD_MS)
    assert len([edge for edge in board.pico.edges if edge.output == "light0" and edge.high]) == 2
    assert len(board.pico.watchdog_resets) == 1
    board.pico.run_ms(BOOT_MS)
    assert state_and_faults(board) == (State.FAULT, Fault.WATCHDOG)


def test_the_chip_resets_itself_below_0_946_v(board: Board) -> None:
    """Of its core; after power-up it would be 0.860 V."""
    register = board.pico.read_word(BROWN_OUT)
    assert (register & 1, register >> 4 & 15) == (1, 0b1011)


def test_bytes_interrupt_one_by_one(board: Board) -> None:
    """A FIFO would keep the abort byte back for the time of 32 bits."""
    control = board.pico.read_word(UART_LCR_H)
    word_length, fifo, parity = control >> 5 & 3, control >> 4 & 1, control >> 1 & 1
    assert (word_length, fifo, parity) == (3, 0, 0)


def test_a_hang_that_still_serves_interrupts_is_restarted_too(board: Board) -> None:
    """A line that is never silent and a trigger pin that never rests are no sign of life."""
    board.pico.hang(deaf=False)
    edge_ms = 2
    for edge in range((WATCHDOG_MS + 20) // edge_ms):
        board.send(Command.BEAT)
        board.pico.set_trigger_pin(edge % 2 == 0)
        board.pico.run_ms(edge_ms)
    assert len(board.pico.watchdog_resets) == 1
    assert state_and_faults(board) == (State.FAULT, Fault.WATCHDOG)


def test_an_exception_that_nobody_expects_ends_a_pulse_and_restarts_the_chip(board: Board) -> None:
    raised: list[int] = []

    def disturb() -> None:
        raised.append(board.pico.cycle)
        board.pico.write_word(NVIC_ENABLE, UNEXPECTED)
        board.pico.write_word(NVIC_PEND, UNEXPECTED)

    board.when("light0", True, 10, disturb)
    board.send(Command.FIRE)
    board.pico.run_ms(PERIOD_MS / 2)
    assert (dark_at(board) - raised[0]) * CYCLE_NS < DARK_WITHIN_NS
    assert not lit_after(board, raised[0]), "pulse B is not given"
    assert not any(board.pico.levels().values())
    assert board.pico.set_points_ma() == (0, 0, 0, 0)
    board.pico.write_word(WATCHDOG_LOAD, WATCHDOG_TICKS_PER_MS)  # as if the rest of its time were over
    board.pico.run_ms(1 + BOOT_MS)
    assert len(board.pico.watchdog_resets) == 1
    assert state_and_faults(board) == (State.FAULT, Fault.WATCHDOG)


def test_the_watchdog_takes_pio_and_pins_with_it(board: Board) -> None:
    """The light is high when the processor dies; only reset domains that hold PIO and pins make it dark."""
    high = 3 << 8
    board.pico.write_word(0x4001_4000 + 8 * 2 + 4, high | 3 << 12 | 6)
    assert board.pico.levels()["light0"]
    board.pico.hang()
    board.pico.run_ms(WATCHDOG_MS + BOOT_MS)
    assert [dark_at(board)] == board.pico.watchdog_resets, "by the reset itself, not by the firmware after it"


def test_a_new_power_up_is_told_from_the_old_one(board: Board) -> None:
    before = board.ask(Command.ID).boot
    board.pico.power_up()
    assert not any(board.pico.levels().values())
    board.pico.run_ms(BOOT_MS)
    reply = board.ask(Command.STATUS)
    assert reply.boot != before
    assert (State(reply.number("state")), reply.number("faults"), reply.number("fired")) == (State.SAFE, 0, 0)


def test_a_stop_that_is_pressed_before_the_power_comes_is_a_fault(board: Board) -> None:
    """There is no edge to be seen."""
    board.pico.set_estop(False)
    board.pico.power_up()
    board.pico.run_ms(BOOT_MS)
    assert state_and_faults(board) == (State.FAULT, Fault.ESTOP)
    assert board.ask(Command.CLEAR).error is ErrorNumber.ESTOP_OPEN
    board.pico.set_estop(True)
    assert state_and_faults(board) == (State.FAULT, Fault.ESTOP)
    assert board.ask(Command.CLEAR).error is None


def test_the_outputs_never_move_while_it_starts() -> None:
    board = Board()
    assert board.pico.edges == []
    assert not any(board.pico.levels().values())


def test_the_stack_stays_within_what_was_computed_for_it(board: Board) -> None:
    words = range(RAM, RAM + STACK_SIZE - 256, 4)
    for address in words:
        board.pico.write_word(address, PAINT)
    board.when("light0", True, 5, lambda: board.pico.set_interlock(False))
    fire(board)
    board.pico.set_interlock(True)
    board.ask(Command.CLEAR)
    board.configure([LONG] * 4)
    board.ask(Command.STATUS)
    board.say(b"x" * 200 + b"\n")
    untouched = next(address for address in words if board.pico.read_word(address) != PAINT) - RAM
    assert STACK_SIZE - untouched <= STACK_BOUND
