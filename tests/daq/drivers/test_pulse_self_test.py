"""The self-test passes on the firmware's core, gives no light, and sees what is wrong."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from daq.drivers.pulse_line import PulseLine
from daq.drivers.pulse_protocol import Command, State
from daq.drivers.pulse_self_test import Verdict, self_test
from daq.errors import DeviceError
from daq.shot import FiredTrain
from daq.simulation.pico.firmware_process import FirmwareProcess

CHANNELS = {"left": 0, "right": 1}


@contextmanager
def opened(firmware: FirmwareProcess) -> Iterator[PulseLine]:
    line = PulseLine("generator", firmware.port)
    line.open()
    try:
        yield line
    finally:
        line.close()


def results_of(firmware: FirmwareProcess) -> dict[str, tuple[Verdict, str]]:
    line = PulseLine("generator", firmware.port)
    identity = line.open()
    try:
        return {check.name: (check.verdict, check.detail) for check in self_test(line, identity)}
    finally:
        line.close()


def failures(checks: dict[str, tuple[Verdict, str]]) -> list[str]:
    return [name for name, (verdict, _) in checks.items() if verdict is Verdict.FAIL]


@pytest.fixture
def shots() -> list[FiredTrain]:
    return []


@pytest.fixture
def firmware(shots: list[FiredTrain]) -> Iterator[FirmwareProcess]:
    with FirmwareProcess(CHANNELS, shots.append) as process:
        yield process


def test_everything_passes_without_light_and_ends_off(firmware: FirmwareProcess, shots: list[FiredTrain]) -> None:
    checks = results_of(firmware)
    assert failures(checks) == []
    assert [name for name, (verdict, _) in checks.items() if verdict is Verdict.SKIPPED] == ["open interlock"]
    with opened(firmware) as line:
        assert line.ask(Command.STATUS).number("state") == State.SAFE
    end_s = time.monotonic() + 5
    while len(shots) < 2 and time.monotonic() < end_s:
        time.sleep(0.01)  # shots are reported by a thread of their own
    assert len(shots) == 2
    assert not any(pulses for train in shots for pulses in train.pulses.values())


def test_it_passes_again_on_the_same_generator(firmware: FirmwareProcess) -> None:
    assert failures(results_of(firmware)) == failures(results_of(firmware)) == []


def test_with_an_open_interlock_it_tries_that_arming_is_refused(
    firmware: FirmwareProcess, shots: list[FiredTrain]
) -> None:
    firmware.set_interlock(False)
    checks = results_of(firmware)
    assert checks["open interlock"] == (Verdict.OK, "ARM refused")
    assert checks["budget and period"] == checks["off"] == (Verdict.SKIPPED, "the interlock is open")
    assert failures(checks) == []
    assert shots == []


def test_a_latched_fault_is_told_and_not_cleared(firmware: FirmwareProcess) -> None:
    firmware.reset(by_watchdog=True)
    checks = results_of(firmware)
    assert checks["starts safe"] == (
        Verdict.FAIL,
        "fault latched: WATCHDOG; see to its cause, then acknowledge it (tomoshadow firmware clear, or the page)",
    )
    assert "answered by FAULT_LATCHED" in checks["off"][1]
    with opened(firmware) as line:
        assert line.ask(Command.STATUS).number("state") == State.FAULT


def test_a_generator_that_dies_fails_every_check(firmware: FirmwareProcess) -> None:
    line = PulseLine("generator", firmware.port)
    checks = self_test(line, line.open())
    assert next(checks).verdict is Verdict.OK
    firmware.kill()
    assert {check.verdict for check in checks} == {Verdict.FAIL}
    line.close()


def test_an_exchange_without_answer_ends_at_its_limit(firmware: FirmwareProcess) -> None:
    firmware.lose_replies(0)
    with opened(firmware) as line:
        firmware.lose_replies(1)
        with pytest.raises(DeviceError, match=r"no answer to .*BEAT"):
            line.exchange(b">1 BEAT*0000\n")
