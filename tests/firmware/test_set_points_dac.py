"""The converter of the set-points: set and read back before ARM answers, zero after every OFF, and honest errors."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest

from daq.drivers.pulse_framing import ABORT_BYTE
from daq.drivers.pulse_protocol import Command, ErrorNumber, Fault, Reply, Request, State, encode_request
from daq.simulation.pico.firmware_build import ImageKind
from daq.simulation.pico.mcp4728 import MA_PER_MV, Mcp4728, Register
from daq.simulation.pico.rp2040_emulator import CYCLES_PER_MS
from tests.support.rp2040_board import BOOT_MS, PAPER, PERIOD_MS, Board

CURRENTS_MA = (10, 9_870, 20_000, 30_000)
DARK_MA = (0, 0, 0, 0)
OFF = 1
"""Power-down by 1 kOhm."""
ZEROED_WITHIN_MS = 0.25
"""A fast write: nine bytes at 400 kHz."""
LOOK_MS = 1.0
"""To give up a look at the converter, and zero it then."""
WATCHDOG_MS = 200
TRIED_AGAIN_MS = 150
HALF_SCALE = Register(internal=False, power_down=0, double=True, steps=2048)


@pytest.fixture
def board() -> Iterator[Board]:
    board = Board()
    board.configure([replace(PAPER, current_ma=current_ma) for current_ma in CURRENTS_MA])
    yield board
    assert not any(board.pico.levels().values())


def converter(board: Board) -> Mcp4728:
    return board.pico.converter


def is_off(board: Board) -> bool:
    return all((register.power_down, register.steps) == (OFF, 0) for register in converter(board).registers)


def arm(board: Board) -> Reply:
    return board.ask(Command.ARM, 1, 0, 0)


def set_point_fault(board: Board) -> bool:
    status = board.ask(Command.STATUS)
    return (status.number("state"), status.number("faults")) == (State.FAULT, Fault.SETPOINT)


def start_arming(board: Board, time_us: int) -> None:
    """Up to this time after the last byte of the line."""
    board.pico.receive(encode_request(Request(60_000, Command.ARM, (1, 0, 0))))
    board.pico.run_until_received()
    board.pico.run(board.pico.cycle + time_us * CYCLES_PER_MS // 1000)


def test_a_register_is_half_a_millivolt_per_step_and_20_a_per_v() -> None:
    register = Register(internal=True, power_down=0, double=False, steps=3000)
    assert register.output_mv == 1500
    assert register.output_mv * MA_PER_MV == 30_000
    assert replace(register, power_down=1).output_mv == 0
    assert replace(register, double=True).output_mv == 3000
    assert replace(register, internal=False).output_mv == pytest.approx(3300 * 3000 / 4096)


def test_currents_are_set_when_arm_answers_and_at_no_other_time(board: Board) -> None:
    assert is_off(board)
    assert arm(board).error is None
    assert board.pico.set_points_ma() == CURRENTS_MA
    assert all(register.internal and not register.double for register in converter(board).registers)
    board.shoot()
    assert board.pico.shot_set_points_ma == CURRENTS_MA
    assert board.pico.set_points_ma() == DARK_MA
    assert is_off(board)


def test_a_dark_channel_keeps_its_output_off(board: Board) -> None:
    board.configure([None, replace(PAPER, current_ma=0), PAPER, None])
    assert arm(board).error is None
    assert [register.power_down for register in converter(board).registers] == [OFF, OFF, 0, OFF]
    assert board.pico.set_points_ma() == (0, 0, 20_000, 0)


def test_whatever_the_converter_does_at_power_up_ends_with_the_start_of_the_firmware() -> None:
    board = Board()
    converter(board).eeprom = (HALF_SCALE,) * 4
    board.pico.power_up()
    assert min(board.pico.set_points_ma()) > 30_000
    board.pico.run_ms(BOOT_MS)
    assert is_off(board)


def test_a_hung_processor_leaves_them_to_the_start_after_the_watchdog(board: Board) -> None:
    assert arm(board).error is None
    board.pico.hang()
    board.pico.run_ms(WATCHDOG_MS - 10)
    assert board.pico.set_points_ma() == CURRENTS_MA
    board.pico.run_ms(10 + BOOT_MS)
    assert len(board.pico.watchdog_resets) == 1
    assert is_off(board)


def test_the_interlock_zeroes_them_in_a_quarter_of_a_millisecond(board: Board) -> None:
    assert arm(board).error is None
    board.pico.set_interlock(False)
    board.pico.run_ms(ZEROED_WITHIN_MS)
    assert is_off(board)
    board.pico.set_interlock(True)


@pytest.mark.parametrize("after_us", [250, 350, 500, 700, 1000, 1200])
def test_an_abort_while_they_are_being_set_leaves_them_zero_and_the_board_safe(board: Board, after_us: int) -> None:
    """The bus is busy with the main loop's transfer when the interrupt wants it."""
    start_arming(board, after_us)
    board.pico.feed(ABORT_BYTE[0])
    board.pico.run_ms(PERIOD_MS)
    assert is_off(board)
    status = board.ask(Command.STATUS)
    assert (status.number("state"), status.number("shots_left")) == (0, 0)
    assert board.ask(Command.FIRE).error is ErrorNumber.NOT_ARMED
    assert arm(board).error is None, "and the bus works"
    assert board.pico.set_points_ma() == CURRENTS_MA


def test_without_a_converter_it_does_not_arm(board: Board) -> None:
    converter(board).connected = False
    assert arm(board).error is ErrorNumber.HARDWARE
    assert board.ask(Command.FIRE).error is ErrorNumber.FAULT_LATCHED
    assert set_point_fault(board)
    converter(board).connected = True
    board.pico.run_ms(TRIED_AGAIN_MS)
    assert board.ask(Command.CLEAR).error is None
    assert arm(board).error is None


def test_a_zero_that_is_not_confirmed_is_a_fault_that_lasts_as_long(board: Board) -> None:
    assert arm(board).error is None
    converter(board).frozen = True
    board.ask(Command.OFF)
    board.pico.run_ms(PERIOD_MS)
    assert board.pico.set_points_ma() == CURRENTS_MA, "they are stuck"
    assert set_point_fault(board)
    assert arm(board).error is ErrorNumber.FAULT_LATCHED
    assert board.ask(Command.LIGHT, 1000, 100, 0, 0, 0).error is ErrorNumber.FAULT_LATCHED
    assert board.ask(Command.CLEAR).error is ErrorNumber.HARDWARE
    converter(board).frozen = False
    board.pico.run_ms(TRIED_AGAIN_MS)
    assert is_off(board)
    assert set_point_fault(board), "it latches"
    assert board.ask(Command.CLEAR).error is None
    assert arm(board).error is None


def test_it_starts_with_a_fault_where_no_converter_answers() -> None:
    board = Board()
    converter(board).connected = False
    board.pico.power_up()
    board.pico.run_ms(BOOT_MS)
    assert set_point_fault(board)


def test_a_converter_that_does_not_take_its_values_is_found_by_reading_back(board: Board) -> None:
    converter(board).frozen = True
    assert arm(board).error is ErrorNumber.HARDWARE
    assert board.pico.set_points_ma() == DARK_MA


def test_a_converter_that_was_cut_off_in_mid_byte_is_clocked_free(board: Board) -> None:
    converter(board).holding = True
    assert arm(board).error is None
    assert board.pico.set_points_ma() == CURRENTS_MA


def test_a_bus_that_stays_stuck_is_an_error_in_time(board: Board) -> None:
    converter(board).holding = converter(board).wedged = True
    start = board.pico.cycle
    assert arm(board).error is ErrorNumber.HARDWARE
    assert (board.pico.cycle - start) / CYCLES_PER_MS < 60
    board.pico.run_ms(PERIOD_MS)
    assert board.pico.watchdog_resets == []
    assert set_point_fault(board)
    converter(board).wedged = False


def test_a_restart_amid_a_transfer_frees_the_bus(board: Board) -> None:
    start_arming(board, 600)
    assert not is_off(board)
    board.pico.hang()
    board.pico.run_ms(WATCHDOG_MS + BOOT_MS)
    assert len(board.pico.watchdog_resets) == 1
    assert is_off(board)


CHANGES: dict[str, Callable[[Mcp4728], None]] = {
    "gain": lambda chip: change(chip, 2, double=True),
    "reference": lambda chip: change(chip, 1, internal=False),
    "power-down": lambda chip: change(chip, 3, power_down=2),
    "steps": lambda chip: change(chip, 0, steps=2),
    "unplugged": lambda chip: setattr(chip, "connected", False),
    "stuck": lambda chip: setattr(chip, "wedged", True),
}
NOTICED_WITHIN_MS = 40
"""Two looks at all of it, 10 ms apart."""


def change(chip: Mcp4728, channel: int, **fields: int | bool) -> None:
    chip.registers[channel] = replace(chip.registers[channel], **fields)  # type: ignore[arg-type]


@pytest.mark.parametrize("what", CHANGES)
def test_a_converter_that_changes_while_armed_trips(board: Board, what: str) -> None:
    assert arm(board).error is None
    board.pico.run_ms(3 * PERIOD_MS)
    assert State(board.ask(Command.STATUS).number("state")) is State.ARMED
    converter(board).holding = what == "stuck"
    CHANGES[what](converter(board))
    board.pico.run_ms(NOTICED_WITHIN_MS)
    assert board.ask(Command.FIRE).error is ErrorNumber.FAULT_LATCHED
    converter(board).connected, converter(board).wedged = True, False
    assert set_point_fault(board)
    board.pico.run_ms(TRIED_AGAIN_MS)
    assert board.ask(Command.CLEAR).error is None
    assert is_off(board)


def test_a_converter_that_changes_while_replies_are_sent_trips_as_soon() -> None:
    board = Board()
    board.pico.run_ms(2 * PERIOD_MS)
    board.configure([PAPER] * 4)
    assert arm(board).error is None
    board.pico.pace_serial_line()
    board.pico.receive(b"".join(encode_request(Request(100 + i, Command.STATUS, ())) for i in range(3)))
    board.pico.run_ms(PERIOD_MS)
    change(converter(board), 2, double=True)
    board.pico.run_ms(NOTICED_WITHIN_MS)
    assert board.pico.set_points_ma() == (0, 0, 0, 0)


def test_a_converter_that_changes_while_safe_is_a_fault_too(board: Board) -> None:
    change(converter(board), 1, power_down=0, steps=3000)
    board.pico.run_ms(2 * TRIED_AGAIN_MS)
    assert set_point_fault(board)
    assert is_off(board)


def test_a_single_disturbed_answer_is_asked_again(board: Board) -> None:
    assert arm(board).error is None
    converter(board).disturbed = 1
    board.pico.run_ms(5 * PERIOD_MS)
    assert converter(board).disturbed == 0
    assert State(board.ask(Command.STATUS).number("state")) is State.ARMED


def test_a_bus_that_its_clocks_set_free_while_armed_is_no_fault(board: Board) -> None:
    assert arm(board).error is None
    converter(board).holding = True
    board.pico.run_ms(5 * PERIOD_MS)
    assert not converter(board).holding
    assert State(board.ask(Command.STATUS).number("state")) is State.ARMED


def test_an_off_while_it_is_being_looked_at_zeroes_it_at_once(board: Board) -> None:
    for wait_us in range(0, 12_000, 1_700):
        assert board.ask(Command.ARM, 1, 0, 0).error is None
        board.pico.run(board.pico.cycle + wait_us * CYCLES_PER_MS // 1000)
        board.pico.feed(ABORT_BYTE[0])
        board.pico.run_ms(ZEROED_WITHIN_MS + LOOK_MS)
        assert board.pico.set_points_ma() == DARK_MA, wait_us
        board.pico.run_ms(PERIOD_MS)


def test_an_eeprom_that_is_not_zero_is_written(board: Board) -> None:
    converter(board).eeprom = (HALF_SCALE,) * 4
    board.pico.power_up()
    board.pico.run_ms(TRIED_AGAIN_MS)
    assert all(kept.output_mv == 0 for kept in converter(board).eeprom)
    board.pico.power_up()
    assert board.pico.set_points_ma() == DARK_MA
    board.pico.run_ms(BOOT_MS)
    assert board.ask(Command.STATUS).number("faults") == 0


def test_an_eeprom_that_cannot_be_written_is_a_fault(board: Board) -> None:
    converter(board).eeprom = (HALF_SCALE,) * 4
    board.pico.power_up()
    converter(board).registers = [Register(internal=True, power_down=OFF, double=False, steps=0)] * 4
    converter(board).frozen = True
    board.pico.run_ms(5 * TRIED_AGAIN_MS)
    assert set_point_fault(board)
    assert board.ask(Command.CLEAR).error is ErrorNumber.HARDWARE


def test_a_current_that_changed_in_memory_does_not_reach_the_gain(board: Board) -> None:
    """In the last moment, behind all checks of the core: 60 A would be half of them, at gain 2."""
    wanted = [a for a in range(0x2000_0000, 0x2000_4000, 4) if board.pico.read_word(a) == CURRENTS_MA[1]]
    board.pico.receive(encode_request(Request(60_000, Command.ARM, (1, 0, 0))))
    board.pico.run_until_received()
    for _ in range(400):
        board.pico.run(board.pico.cycle + 125)
        stack = [a for a in range(0x2000_0000, 0x2000_0400, 4) if board.pico.read_word(a) == CURRENTS_MA[1]]
        for address in set(stack) - set(wanted):
            board.pico.write_word(address, 60_000)
    board.pico.run_ms(PERIOD_MS)
    assert not any(register.double for register in converter(board).registers)


def test_the_board_without_a_converter_sets_currents_by_pwm() -> None:
    board = Board(ImageKind.PWM)
    before = list(converter(board).registers)
    board.configure([replace(PAPER, current_ma=current_ma) for current_ma in CURRENTS_MA])
    assert arm(board).error is None
    assert board.pico.set_points_ma() == CURRENTS_MA
    board.shoot()
    assert board.pico.set_points_ma() == DARK_MA
    assert converter(board).registers == before
