"""What every pulse generator does: the real driver against the firmware on a pseudo-terminal, and one in memory.

What only the firmware does is tested on a ``board``.
"""

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Protocol

import pytest
import serial

from daq.devices import GeneratorState, PulseGenerator, TriggerSource
from daq.drivers.pulse_protocol import COUNTERS, HEARTBEAT_MS, Command, Request, State, decode_reply, encode_request
from daq.drivers.serial_pulse_generator import SerialPulseGenerator
from daq.errors import DeviceError, DeviceRefused, PlanError
from daq.run_plan import PulsePair, RunPlan
from daq.shot import FiredTrain
from daq.simulation.pico.firmware_process import FirmwareProcess
from daq.timing import CameraTiming, ShotTiming, Window, plan_shot_timing
from tests.support.memory_devices import MemoryGenerator

CHANNELS = {"left": 0, "middle": 2, "right": 3}
CAMERA = CameraTiming(
    trigger_delay_ns=1_003, exposure_a_ns=20_000, gap_ns=500, exposure_b_ns=30_000_000, readout_ns=1_000_000
)
PERIOD_MS, LONG_PERIOD_MS = 10, 20
CONVERTER_FOUND_MS = 150
"""A converter that failed is tried ten times a second."""
SETTLE_S = 0.020
"""From the set-points of pulses to those of continuous light, at least."""
LIMIT_S = 5.0


def shot_timing(width_ns: int = 1000, separation_ns: int = 6400, **current_a: float) -> ShotTiming:
    currents = dict.fromkeys(CHANNELS, 20.0) | current_a
    pulse = PulsePair(width_ns=width_ns, separation_ns=separation_ns, current_a=currents)
    return plan_shot_timing(RunPlan(name="contract", shots=1, pulse=pulse), dict.fromkeys(CHANNELS, CAMERA))


class Surroundings(Protocol):
    """What surrounds a generator: a door, time, and continuous light that comes out."""

    @property
    def light_a(self) -> Mapping[str, float]: ...

    def set_interlock(self, closed: bool) -> None: ...

    def advance(self, time_ms: int) -> None: ...


@dataclass
class Stand:
    """A generator, what surrounds it, and the pulses that it gave."""

    generator: PulseGenerator
    around: Surroundings
    light: list[FiredTrain] = field(default_factory=list)
    changed: threading.Condition = field(default_factory=threading.Condition)

    def wait_for_light(self, shots: int) -> list[FiredTrain]:
        with self.changed:
            assert self.changed.wait_for(lambda: len(self.light) >= shots, LIMIT_S), f"{len(self.light)} of {shots}"
        return self.light

    def let_period_pass(self) -> None:
        self.around.advance(PERIOD_MS)

    def see(self, train: FiredTrain) -> None:
        with self.changed:
            self.light.append(train)
            self.changed.notify_all()


@dataclass
class Board(Stand):
    """The driver, and the firmware behind it."""

    generator: SerialPulseGenerator
    around: FirmwareProcess


@contextmanager
def board_with(*, emulated: bool) -> Iterator[Board]:
    with (
        FirmwareProcess(CHANNELS, lambda train: opened.see(train), emulated=emulated) as firmware,
        SerialPulseGenerator("generator", firmware.port, CHANNELS, clock_s=firmware.clock_s) as generator,
    ):
        opened = Board(generator, firmware)
        yield opened


@contextmanager
def in_memory() -> Iterator[Stand]:
    with MemoryGenerator("generator", [], CHANNELS, lambda train: opened.see(train)) as generator:
        opened = Stand(generator, generator)
        yield opened


OPENINGS: Mapping[str, Callable[[], AbstractContextManager[Stand]]] = {
    "host": partial(board_with, emulated=False),
    "emulated": partial(board_with, emulated=True),
    "memory": in_memory,
}
# Not where the answer depends on how fast the emulator is: its time is that of the wall clock.
everywhere = pytest.mark.parametrize("stand", OPENINGS, indirect=True)
on_the_real_image_too = pytest.mark.parametrize("board", [False, True], ids=["host", "emulated"], indirect=True)


@pytest.fixture(params=["host", "memory"])
def stand(request: pytest.FixtureRequest) -> Iterator[Stand]:
    with OPENINGS[request.param]() as stand:
        yield stand


@pytest.fixture(params=[False], ids=["host"])
def board(request: pytest.FixtureRequest) -> Iterator[Board]:
    with board_with(emulated=request.param) as board:
        yield board


@pytest.fixture
def generator(stand: Stand) -> PulseGenerator:
    return stand.generator


@pytest.fixture
def armed(stand: Stand) -> Stand:
    arm(stand.generator)
    return stand


@pytest.fixture
def armed_board(board: Board) -> Board:
    arm(board.generator)
    return board


def arm(generator: PulseGenerator) -> None:
    generator.configure(shot_timing())
    generator.arm(5)


def test_light_is_off_after_opening(generator: PulseGenerator) -> None:
    status = generator.status()
    assert status.state is GeneratorState.SAFE
    assert status.shots_left == 0
    assert set(status.counters) == set(COUNTERS)


def test_it_names_itself(generator: PulseGenerator) -> None:
    identity = generator.identity()
    assert generator.name == "generator"
    assert all((identity.vendor, identity.model, identity.serial, identity.firmware))


def test_it_says_who_it_is(board: Board) -> None:
    identity = board.generator.identity()
    assert identity.model == "tomoshadow-pulse"
    assert identity.serial
    assert identity.firmware.startswith("4.")


def test_light_is_off_after_closing() -> None:
    with FirmwareProcess(CHANNELS, lambda _: None) as firmware:
        with SerialPulseGenerator("generator", firmware.port, CHANNELS) as generator:
            generator.configure(shot_timing())
            generator.arm(5)
        with serial.Serial(firmware.port, timeout=LIMIT_S) as port:  # the driver would switch off by opening
            port.write(encode_request(Request(60_000, Command.BEAT)))
            assert decode_reply(port.read_until(b"\n")).number("state") == State.SAFE


def test_actual_values_are_whole_ticks_and_the_separation_is_exact(generator: PulseGenerator) -> None:
    actual = generator.configure(shot_timing(width_ns=1003))
    assert actual.sequence == 0
    for pulse_a, pulse_b in actual.pulses.values():
        assert pulse_b.start_ns - pulse_a.start_ns == 6400
        assert (pulse_a.width_ns, pulse_b.width_ns) == (1000, 1000)
        assert pulse_a.current_a == 20.0
    edges = [*actual.camera_trigger_ns.values(), *(p.start_ns for pair in actual.pulses.values() for p in pair)]
    assert all(edge >= 0 and edge % 8 == 0 for edge in edges)


def test_camera_trigger_keeps_its_distance_to_pulse_a(generator: PulseGenerator) -> None:
    timing = shot_timing()
    actual = generator.configure(timing)
    for view, edges in timing.views.items():
        distance_ns = actual.pulses[view][0].start_ns - actual.camera_trigger_ns[view]
        assert abs(distance_ns + edges.camera_trigger_ns) <= 4


@everywhere
def test_what_is_fired_is_what_was_answered(stand: Stand) -> None:
    configured = stand.generator.configure(shot_timing(middle=12.5))
    stand.generator.arm(1)
    fired = stand.generator.fire()
    assert fired == replace(configured, sequence=1)
    assert stand.wait_for_light(1) == [fired]


@everywhere
def test_a_dark_view_gets_its_trigger_and_no_light(stand: Stand) -> None:
    stand.generator.configure(shot_timing(left=0.0, middle=0.0, right=0.0))
    stand.generator.arm(1)
    fired = stand.generator.fire()
    assert set(fired.camera_trigger_ns) == set(CHANNELS)
    assert all(pulses == () for pulses in fired.pulses.values())
    assert stand.wait_for_light(1) == [fired]


@everywhere
def test_the_budget_is_exact(armed: Stand) -> None:
    for shot in range(5):
        assert armed.generator.status().shots_left == 5 - shot
        assert armed.generator.fire().sequence == shot + 1
        armed.let_period_pass()
    assert armed.generator.status().state is GeneratorState.SAFE
    with pytest.raises(DeviceRefused, match="not armed"):
        armed.generator.fire()
    assert len(armed.wait_for_light(5)) == 5


def test_nothing_fires_before_arming(stand: Stand) -> None:
    with pytest.raises(DeviceRefused, match="not armed"):
        stand.generator.fire()
    with pytest.raises(DeviceRefused, match="no pulse train"):
        stand.generator.arm(1)
    stand.generator.configure(shot_timing())
    with pytest.raises(DeviceRefused, match="not armed"):
        stand.generator.fire()
    assert stand.generator.status().counters == {
        **dict.fromkeys(COUNTERS, 0), "requested": 2, "suppressed": 2
    }  # fmt: skip
    assert stand.light == []


@pytest.mark.parametrize("shots", [0, 1_000_001])
def test_an_impossible_budget_is_refused(generator: PulseGenerator, shots: int) -> None:
    generator.configure(shot_timing())
    with pytest.raises(DeviceRefused, match="shot budget"):
        generator.arm(shots)
    assert generator.status().state is GeneratorState.SAFE


@pytest.mark.parametrize(("width_ns", "shortest_us"), [(1000, 10_000), (2000, 20_000)])
def test_the_shortest_period_that_arming_tells_is_enough(stand: Stand, width_ns: int, shortest_us: int) -> None:
    stand.generator.configure(shot_timing(width_ns=width_ns))
    told_us = stand.generator.arm(2)
    assert told_us == pytest.approx(shortest_us, rel=0.01)
    stand.generator.fire()
    stand.around.advance(-(-told_us // 1000))
    assert stand.generator.fire().sequence == 2


def test_an_early_shot_is_not_fired_and_counted(stand: Stand) -> None:
    """Of a train with the longest of the shortest periods: the second one must come in time on a busy computer too."""
    stand.generator.configure(shot_timing(width_ns=2000))
    stand.generator.arm(5)
    stand.generator.fire()
    with pytest.raises(DeviceRefused, match="shortest period"):
        stand.generator.fire()
    status = stand.generator.status()
    assert status.state is GeneratorState.ARMED
    assert status.shots_left == 4
    assert (status.counters["fired"], status.counters["suppressed"], status.counters["early"]) == (1, 1, 1)
    stand.around.advance(2 * PERIOD_MS)
    assert stand.generator.fire().sequence == 2


def test_configure_and_arm_are_refused_while_armed(armed: Stand) -> None:
    with pytest.raises(DeviceRefused, match="armed"):
        armed.generator.configure(shot_timing())
    with pytest.raises(DeviceRefused, match="armed"):
        armed.generator.arm(100)
    assert armed.generator.status().shots_left == 5


def test_a_refused_train_leaves_nothing_to_arm(generator: PulseGenerator) -> None:
    generator.configure(shot_timing())
    legal = shot_timing().views["left"]
    late_a = replace(legal, pulse_a=Window(3_000, 4_000))
    with pytest.raises(DeviceRefused, match="frame A closes"):
        generator.configure(ShotTiming({"left": late_a}, 0))
    with pytest.raises(DeviceRefused, match="no pulse train"):
        generator.arm(1)


def test_a_view_without_channel_is_named(generator: PulseGenerator) -> None:
    views = shot_timing().views
    with pytest.raises(PlanError, match="behind"):
        generator.configure(ShotTiming({"behind": views["left"]}, 0))


@everywhere
def test_off_disarms_in_every_state(armed: Stand) -> None:
    armed.generator.off()
    assert armed.generator.status().state is GeneratorState.SAFE
    assert armed.generator.status().shots_left == 0
    armed.generator.off()
    with pytest.raises(DeviceRefused, match="not armed"):
        armed.generator.fire()
    armed.generator.arm(1)
    armed.around.set_interlock(False)
    armed.generator.off()
    assert armed.generator.status().state is GeneratorState.FAULT


def test_off_works_while_another_thread_asks_without_pause(armed: Stand) -> None:
    reasons: set[str] = set()
    finished = threading.Event()

    def ask_without_pause() -> None:
        while not finished.is_set():
            try:
                armed.generator.status()
            except DeviceError as error:
                reasons.add(error.reason)

    thread = threading.Thread(target=ask_without_pause)
    thread.start()
    for _ in range(50):
        armed.generator.off()
        assert armed.generator.status().state is GeneratorState.SAFE
        armed.generator.arm(5)
    armed.generator.off()
    finished.set()
    thread.join(LIMIT_S)
    assert reasons <= {"STATUS was overtaken by off"}
    assert armed.generator.status().state is GeneratorState.SAFE


@on_the_real_image_too
def test_a_silent_host_trips_and_clear_acknowledges(armed_board: Board) -> None:
    armed_board.around.advance(HEARTBEAT_MS + 1)
    status = armed_board.generator.status()
    assert (status.state, status.faults) == (GeneratorState.FAULT, ("heartbeat",))
    with pytest.raises(DeviceRefused, match="fault is latched"):
        armed_board.generator.fire()
    armed_board.generator.clear()
    status = armed_board.generator.status()
    assert (status.state, status.faults, status.shots_left) == (GeneratorState.SAFE, (), 0)


def test_status_is_the_heartbeat(armed_board: Board) -> None:
    for _ in range(4):
        armed_board.around.advance(HEARTBEAT_MS // 2)
        assert armed_board.generator.status().state is GeneratorState.ARMED


@everywhere
def test_an_opened_interlock_latches(armed: Stand) -> None:
    armed.around.set_interlock(False)
    status = armed.generator.status()
    assert (status.state, status.faults, status.interlock_closed) == (GeneratorState.FAULT, ("interlock",), False)
    with pytest.raises(DeviceRefused, match="interlock is open"):
        armed.generator.clear()
    armed.around.set_interlock(True)
    assert armed.generator.status().state is GeneratorState.FAULT
    armed.generator.clear()
    assert armed.generator.status().state is GeneratorState.SAFE
    assert armed.light == []


def test_an_open_interlock_forbids_arming(stand: Stand) -> None:
    stand.generator.configure(shot_timing())
    stand.around.set_interlock(False)
    with pytest.raises(DeviceRefused, match="interlock is open"):
        stand.generator.arm(1)
    stand.around.set_interlock(True)
    stand.generator.arm(1)


@on_the_real_image_too
def test_the_emergency_stop_latches_in_every_state(board: Board) -> None:
    board.around.set_estop(False)
    status = board.generator.status()
    assert (status.state, status.faults, status.estop_closed) == (GeneratorState.FAULT, ("estop",), False)
    with pytest.raises(DeviceRefused, match="emergency stop is open"):
        board.generator.clear()
    board.around.set_estop(True)
    with pytest.raises(DeviceRefused, match="fault is latched"):
        board.generator.configure(shot_timing())
    board.generator.clear()
    status = board.generator.status()
    assert (status.state, status.faults, status.estop_closed) == (GeneratorState.SAFE, (), True)


@on_the_real_image_too
def test_set_points_that_are_not_confirmed_as_zero_are_a_fault(board: Board) -> None:
    board.around.set_converter(False)
    board.generator.off()
    board.around.advance(CONVERTER_FOUND_MS)
    status = board.generator.status()
    assert (status.state, status.faults) == (GeneratorState.FAULT, ("setpoint",))
    with pytest.raises(DeviceRefused, match="something in it does not read as it should"):
        board.generator.clear()
    board.around.set_converter(True)
    board.around.advance(CONVERTER_FOUND_MS)
    with pytest.raises(DeviceRefused, match="fault is latched"):
        board.generator.configure(shot_timing())
    board.generator.clear()
    assert board.generator.status().state is GeneratorState.SAFE


@on_the_real_image_too
def test_an_external_edge_fires(board: Board) -> None:
    configured = board.generator.configure(shot_timing())
    board.generator.arm(2, TriggerSource.EXTERNAL)
    board.let_period_pass()
    board.around.trigger()
    assert board.wait_for_light(1) == [replace(configured, sequence=1)]
    assert board.generator.status().shots_left == 1


def test_external_edges_fire_within_period_and_budget(board: Board) -> None:
    """Of a train with the longest of the shortest periods: the second edge must be early on a busy computer too."""
    configured = board.generator.configure(shot_timing(width_ns=2000))
    board.generator.arm(2, TriggerSource.EXTERNAL)
    board.around.advance(LONG_PERIOD_MS)
    board.around.trigger()
    board.around.trigger()  # early
    board.around.advance(LONG_PERIOD_MS)
    board.around.trigger()
    board.around.advance(LONG_PERIOD_MS)
    board.around.trigger()  # beyond the budget
    assert [replace(train, sequence=0) for train in board.wait_for_light(2)] == [configured] * 2
    status = board.generator.status()
    assert (status.state, status.shots_left) == (GeneratorState.SAFE, 0)
    assert (status.counters["fired"], status.counters["early"], status.counters["cameras"]) == (2, 1, 6)
    assert len(board.light) == 2


def test_the_last_shot_is_told_whoever_fired_it(board: Board) -> None:
    configured = board.generator.configure(shot_timing(width_ns=1003, left=0.0))
    with pytest.raises(DeviceRefused, match="no shot"):
        board.generator.last_fired()
    board.generator.arm(1, TriggerSource.EXTERNAL)
    board.let_period_pass()
    board.around.trigger()
    assert board.generator.last_fired() == replace(configured, sequence=1) == board.wait_for_light(1)[0]


def test_external_edges_do_nothing_when_armed_for_commands(armed_board: Board) -> None:
    armed_board.around.trigger()
    assert armed_board.generator.status().counters["requested"] == 0
    assert armed_board.light == []


def test_the_timer_fires_by_itself(board: Board) -> None:
    board.generator.configure(shot_timing())
    board.generator.arm(3, TriggerSource.TIMER, 20_000)
    with pytest.raises(DeviceRefused, match="another trigger source"):
        board.generator.fire()
    assert len(board.wait_for_light(3)) == 3
    assert board.generator.status().state is GeneratorState.SAFE


@pytest.mark.parametrize("source", TriggerSource)
def test_a_period_that_the_duty_forbids_is_refused_when_arming(board: Board, source: TriggerSource) -> None:
    board.generator.configure(shot_timing(width_ns=2000))  # 4 us at 200 ppm: 20 ms
    with pytest.raises(PlanError, match=r"every 19999 us is too fast .* every 20000 us"):
        board.generator.arm(1, source, 19_999)
    board.generator.arm(1, source, 20_000)
    board.generator.off()


def test_a_very_slow_plan_is_armed(stand: Stand) -> None:
    stand.generator.configure(shot_timing())
    stand.generator.arm(1, period_us=3_600_000_000)
    assert stand.generator.status().state is GeneratorState.ARMED


def test_a_view_may_flash_once(stand: Stand) -> None:
    timing = shot_timing()
    once = {view: replace(edges, pulse_b=Window(0, 0)) for view, edges in timing.views.items()}
    configured = stand.generator.configure(ShotTiming(once, timing.shortest_period_ns))
    assert all(len(pulses) == 1 for pulses in configured.pulses.values())
    stand.generator.arm(1)
    assert stand.generator.fire() == replace(configured, sequence=1)
    assert stand.wait_for_light(1)[0].pulses == configured.pulses


def wait_until_lit(stand: Stand, current_a: dict[str, float]) -> None:
    for _ in range(100):
        stand.around.advance(1)
        if stand.around.light_a == current_a:
            return
    pytest.fail(f"{stand.around.light_a} instead of {current_a}")


@everywhere
def test_continuous_light_comes_and_goes(stand: Stand) -> None:
    stand.around.advance(20)
    stand.generator.light({"left": 0.1, "right": 0.5}, 60.0)
    assert stand.generator.status().state is GeneratorState.LIT
    wait_until_lit(stand, {"left": 0.1, "right": 0.5})
    stand.generator.off()
    assert stand.generator.status().state is GeneratorState.SAFE
    wait_until_lit(stand, {})


def test_continuous_light_ends_with_its_time(stand: Stand) -> None:
    stand.generator.light({"left": 0.1}, 0.05)
    stand.around.advance(100)
    assert stand.generator.status().state is GeneratorState.SAFE
    wait_until_lit(stand, {})


@pytest.mark.parametrize("current_a", [0.0, 0.501, 20.0])
def test_continuous_light_has_a_limit_of_its_own(stand: Stand, current_a: float) -> None:
    with pytest.raises(DeviceRefused, match="continuous light is not 10 to 500 mA"):
        stand.generator.light({"left": current_a}, 1.0)
    with pytest.raises(PlanError, match="behind"):
        stand.generator.light({"behind": 0.1}, 1.0)
    assert stand.generator.status().state is GeneratorState.SAFE


def test_continuous_light_and_pulses_exclude_each_other(armed: Stand) -> None:
    with pytest.raises(DeviceRefused, match="armed or lit"):
        armed.generator.light({"left": 0.1}, 1.0)
    armed.generator.off()
    armed.around.advance(30)
    armed.generator.light({"left": 0.1}, 60.0)
    with pytest.raises(DeviceRefused, match="armed or lit"):
        armed.generator.arm(1)
    with pytest.raises(DeviceRefused, match="armed or lit"):
        armed.generator.configure(shot_timing())


def test_continuous_light_waits_for_the_shortest_period(armed_board: Board) -> None:
    """On a busy computer the waiting time may be over before light is asked for: then it may come."""
    asked_s = time.monotonic()
    armed_board.generator.off()
    refusal = _refusal_of_light(armed_board)
    assert refusal is not None or time.monotonic() - asked_s >= SETTLE_S
    assert refusal is None or "before the shortest period" in refusal
    armed_board.generator.off()
    armed_board.around.advance(LONG_PERIOD_MS + 10)
    armed_board.generator.light({"left": 0.1}, 1.0)


def _refusal_of_light(board: Board) -> str | None:
    try:
        board.generator.light({"left": 0.1}, 1.0)
    except DeviceRefused as error:
        return str(error)
    return None


def test_a_silent_host_ends_continuous_light(board: Board) -> None:
    board.generator.light({"left": 0.1}, 60.0)
    wait_until_lit(board, {"left": 0.1})
    board.around.advance(HEARTBEAT_MS + 1)
    assert board.generator.status().faults == ("heartbeat",)
    wait_until_lit(board, {})


def test_the_generator_keeps_the_limit_of_an_led_for_continuous_light() -> None:
    with (
        FirmwareProcess(CHANNELS, lambda _: None) as firmware,
        SerialPulseGenerator(
            "generator", firmware.port, CHANNELS, max_light_a={"left": 0.2, "right": 0.0}
        ) as generator,
    ):
        for view, current_a in (("left", 0.201), ("right", 0.001)):
            with pytest.raises(DeviceRefused, match="above the limit that was set"):
                generator.light({view: current_a}, 1.0)
        generator.light({"left": 0.2}, 1.0)
        assert generator.status().state is GeneratorState.LIT


def test_one_that_was_not_lost_stays_armed(stand: Stand) -> None:
    stand.generator.configure(shot_timing())
    stand.generator.arm(2)
    stand.generator.recover()
    assert stand.generator.status().state is GeneratorState.ARMED
