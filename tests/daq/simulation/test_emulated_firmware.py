"""The driver on the real image: an emulated Pico behind a pseudo-terminal, in the time of the wall clock."""

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

import pytest

from daq.devices import GeneratorState, TriggerSource
from daq.drivers.pulse_line import LIMIT_S
from daq.drivers.serial_pulse_generator import SerialPulseGenerator
from daq.errors import DeviceError, DeviceRefused, DeviceTimeout, DeviceUnavailable
from daq.run_plan import PulsePair, RunPlan
from daq.shot import FiredTrain
from daq.simulation.pico import firmware_process
from daq.simulation.pico.edge import Edge
from daq.simulation.pico.emulated_firmware import measured_shot
from daq.simulation.pico.firmware_process import FirmwareProcess
from daq.simulation.pico.rp2040_chip import TRIGGER
from daq.simulation.pico.rp2040_emulator import START_CYCLES
from daq.timing import CameraTiming, ShotTiming, plan_shot_timing

pytestmark = pytest.mark.slow

CHANNELS = {"left": 1, "right": 3}
CAMERA = CameraTiming(1_000, 20_000, 500, 30_000_000, 1_000_000)
PERIOD_MS = 10
SHOTS = 20
EDGES = 3


def shot_timing() -> ShotTiming:
    plan = RunPlan(name="emulated", shots=1, pulse=PulsePair(current_a={"left": 9.9, "right": 26.0}))
    return plan_shot_timing(plan, dict.fromkeys(CHANNELS, CAMERA))


@pytest.fixture
def light() -> list[FiredTrain]:
    return []


@pytest.fixture
def firmware(light: list[FiredTrain]) -> Iterator[FirmwareProcess]:
    with FirmwareProcess(CHANNELS, light.append, emulated=True) as process:
        yield process


def driver_of(firmware: FirmwareProcess) -> SerialPulseGenerator:
    return SerialPulseGenerator("generator", firmware.port, CHANNELS, clock_s=firmware.clock_s)


def test_a_day_at_the_bench(firmware: FirmwareProcess, light: list[FiredTrain]) -> None:
    """Twenty shots, a lost reply, an abort, external triggers, the interlock, the emergency stop, the watchdog."""
    with driver_of(firmware) as generator:
        assert generator.identity().firmware.split()[-1].startswith("rp2040")
        configured = generator.configure(shot_timing())
        generator.arm(SHOTS + 10)
        for shot in range(1, SHOTS + 1):
            assert generator.fire() == replace(configured, sequence=shot)
            firmware.advance(PERIOD_MS)
        assert light == [replace(configured, sequence=shot) for shot in range(1, SHOTS + 1)]
        firmware.lose_replies(1)
        assert generator.fire().sequence == SHOTS + 1
        generator.off()
        with pytest.raises(DeviceRefused, match="not armed"):
            generator.fire()
        trigger_from_outside(firmware, generator)
        open_the_interlock(firmware, generator)
        press_the_stop(firmware, generator)
        fired = generator.last_fired()
        assert light == [replace(configured, sequence=shot) for shot in range(1, fired.sequence + 1)]
        firmware.reset(by_watchdog=True)
        with pytest.raises(DeviceError, match="reset"):
            generator.status()
    with driver_of(firmware) as generator:
        status = generator.status()
        assert (status.state, status.faults) == (GeneratorState.FAULT, ("watchdog",))


def trigger_from_outside(firmware: FirmwareProcess, generator: SerialPulseGenerator) -> None:
    """Three permitted shots by edges; the one after them does nothing, and neither does FIRE."""
    before = generator.status().counters["fired"]
    generator.arm(EDGES, TriggerSource.EXTERNAL)
    with pytest.raises(DeviceRefused, match="another trigger source"):
        generator.fire()
    for _ in range(EDGES + 1):
        firmware.advance(PERIOD_MS)
        firmware.trigger()
    status = generator.status()
    assert (status.state, status.shots_left) == (GeneratorState.SAFE, 0)
    assert status.counters["fired"] == before + EDGES


def open_the_interlock(firmware: FirmwareProcess, generator: SerialPulseGenerator) -> None:
    """It latches, forbids CLEAR while it is open, and nothing arms by itself."""
    generator.arm(1)
    firmware.set_interlock(False)
    status = generator.status()
    assert (status.state, status.faults, status.interlock_closed) == (GeneratorState.FAULT, ("interlock",), False)
    with pytest.raises(DeviceRefused, match="interlock"):
        generator.clear()
    firmware.set_interlock(True)
    generator.clear()
    with pytest.raises(DeviceRefused, match="not armed"):
        generator.fire()


def press_the_stop(firmware: FirmwareProcess, generator: SerialPulseGenerator) -> None:
    """It trips a generator that is safe, too."""
    firmware.set_estop(False)
    assert generator.status().faults == ("estop",)
    with pytest.raises(DeviceRefused, match="stop"):
        generator.clear()
    firmware.set_estop(True)
    generator.clear()
    assert generator.status().state is GeneratorState.SAFE


def test_a_busy_computer_is_no_silent_generator(firmware: FirmwareProcess) -> None:
    """The driver waits in the time of the board, which is given no processor for longer than the driver would wait."""
    with driver_of(firmware) as generator:
        os.kill(firmware.pid, signal.SIGSTOP)
        going_on = threading.Timer(1.5 * LIMIT_S, os.kill, (firmware.pid, signal.SIGCONT))
        going_on.start()
        stopped_s = firmware.clock_s()
        assert generator.status().state is GeneratorState.SAFE
        assert firmware.clock_s() - stopped_s < LIMIT_S
        going_on.join()


def test_a_silent_generator_is_named_in_its_own_time(firmware: FirmwareProcess) -> None:
    with driver_of(firmware) as generator:
        firmware.lose_replies(100)
        asked_s = firmware.clock_s()
        with pytest.raises(DeviceTimeout, match="STATUS"):
            generator.status()
        assert LIMIT_S <= firmware.clock_s() - asked_s < 2 * LIMIT_S
        firmware.lose_replies(0)


def test_a_generator_that_stands_still_is_named(firmware: FirmwareProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    with suppress(DeviceError), driver_of(firmware) as generator:
        monkeypatch.setattr(firmware_process, "STANDSTILL_S", 0.3)
        os.kill(firmware.pid, signal.SIGSTOP)
        with pytest.raises(DeviceUnavailable, match="stood still"):
            generator.status()


def test_a_pulled_plug_is_named(firmware: FirmwareProcess) -> None:
    with suppress(DeviceError), driver_of(firmware) as generator:
        generator.configure(shot_timing())
        firmware.kill()
        with pytest.raises(DeviceUnavailable):
            generator.status()


def test_a_shot_is_measured_at_the_pins() -> None:
    def edges(output: str, *times_ns: int) -> list[Edge]:
        return [Edge(1000 + START_CYCLES + at // 8, output, i % 2 == 0) for i, at in enumerate(times_ns)]

    shot = [
        Edge(1000, TRIGGER, True),
        *edges("camera1", 0, 10_000),
        *edges("camera2", 80, 10_080),
        *edges("light1", 20_000, 21_000, 26_400, 27_400),
        *edges("light2", 20_000, 20_400),
    ]
    assert measured_shot(shot, (0, 9900, 5000, 0)) == [
        *(1, 0, 20_000, 1000, 26_400, 1000, 9900),
        *(2, 80, 20_000, 400, 0, 0, 5000),
    ]
