"""The test with light passes on the firmware's core with somebody who does what he is told, and sees what is wrong."""

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import pytest

from daq.drivers import pulse_light_test
from daq.drivers.pulse_light_test import light_test
from daq.drivers.pulse_self_test import Verdict
from daq.drivers.serial_pulse_generator import SerialPulseGenerator
from daq.run_plan import PulsePair, RunPlan
from daq.shot import FiredTrain
from daq.simulation.pico.firmware_process import FirmwareProcess
from daq.timing import CameraTiming, plan_shot_timing

CHANNELS = {"left": 0, "right": 1}
CAMERA = CameraTiming(
    trigger_delay_ns=1_003, exposure_a_ns=20_000, gap_ns=500, exposure_b_ns=30_000_000, readout_ns=1_000_000
)
TIMING = plan_shot_timing(
    RunPlan(name="light", shots=1, pulse=PulsePair(current_a={"left": 9.9, "right": 25.0})),
    dict.fromkeys(CHANNELS, CAMERA),
)
REACTION_S = 0.3
PULSES, STOPS = ["pulses of left", "pulses of right"], ["door or key", "emergency stop", "set-point converter"]


@dataclass
class Scripted:
    """Acts on the wires of the simulated generator a moment after being told."""

    acts: dict[str, Callable[[], None]]
    blind_to: str = "(nothing)"
    left_out: str = "(nothing)"
    asked: list[str] = field(default_factory=list)

    def ready(self, task: str) -> bool:
        self.asked.append(task)
        if self.left_out in task:
            return False
        for words, act in self.acts.items():
            if words in task:
                threading.Timer(REACTION_S, act).start() if "meanwhile" in task else act()
        return True

    def confirms(self, question: str) -> bool:
        self.asked.append(question)
        return self.blind_to not in question


@pytest.fixture
def fired() -> list[FiredTrain]:
    return []


@pytest.fixture
def firmware(fired: list[FiredTrain]) -> Iterator[FirmwareProcess]:
    with FirmwareProcess(CHANNELS, fired.append) as process:
        yield process


def acts_on(firmware: FirmwareProcess) -> dict[str, Callable[[], None]]:
    return {
        "open a door": lambda: firmware.set_interlock(False),
        "close it": lambda: firmware.set_interlock(True),
        "press the emergency": lambda: firmware.set_estop(False),
        "release it": lambda: firmware.set_estop(True),
        "unplug the": lambda: firmware.set_converter(False),
        "plug it in": lambda: firmware.set_converter(True),
    }


def lit_views(train: FiredTrain) -> set[str]:
    return {view for view, pulses in train.pulses.items() if any(pulse.current_a for pulse in pulses)}


def verdicts(firmware: FirmwareProcess, operator: Scripted) -> dict[str, tuple[Verdict, str]]:
    with SerialPulseGenerator("generator", firmware.port, CHANNELS) as generator:
        checks = {check.name: (check.verdict, check.detail) for check in light_test(generator, TIMING, operator)}
        assert generator.status().shots_left == 0
    return checks


def test_everything_passes_with_somebody_who_does_as_told(firmware: FirmwareProcess, fired: list[FiredTrain]) -> None:
    checks = verdicts(firmware, Scripted(acts_on(firmware)))
    assert list(checks) == [*PULSES, *STOPS, "silent host"]
    assert {name: check for name, check in checks.items() if check[0] is not Verdict.OK} == {}
    assert checks["pulses of left"][1] == "pulses of 1000 and 1000 ns, 6400 ns apart, 9.9 A"
    one_view = [
        {view for view, pulses in train.pulses.items() if any(p.current_a for p in pulses)} for train in fired[:2]
    ]
    assert one_view == [{"left"}, {"right"}]


def test_what_is_not_seen_or_not_done_is_told(firmware: FirmwareProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pulse_light_test, "WAIT_S", 1.0)
    monkeypatch.setattr(pulse_light_test, "SILENCE_S", 0.2)
    acts = acts_on(firmware)
    del acts["press the emergency"]
    checks = verdicts(firmware, Scripted(acts, blind_to="25 A", left_out="unplug"))
    assert checks["pulses of right"] == (Verdict.FAIL, "pulses of 1000 and 1000 ns, 6400 ns apart, 25 A: not seen so")
    assert checks["door or key"][0] is Verdict.OK
    assert checks["emergency stop"] == (Verdict.FAIL, "nothing was noticed within 1 s")
    assert checks["set-point converter"] == (Verdict.SKIPPED, "left out by the operator")
    assert checks["silent host"] == (Verdict.FAIL, "faults after 0.2 s of silence: none")


def test_the_wrong_stop_is_told(firmware: FirmwareProcess) -> None:
    acts = acts_on(firmware) | {"open a door": lambda: firmware.set_estop(False)}
    checks = verdicts(firmware, Scripted(acts, left_out="says nothing more"))
    assert checks["door or key"] == (Verdict.FAIL, "fault estop, not interlock")
