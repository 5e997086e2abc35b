"""Far ends of a simulated rig in a process of their own: they outlive whoever works with them, and may be restarted."""

import asyncio
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path

import pytest

from daq.errors import AlreadyHeld, DaqError, DeviceError, DeviceUnavailable
from daq.faults import Fault, FaultKind
from daq.run.acquisition import Acquisition
from daq.run.limits import AcquisitionLimits
from daq.run.state import RunOutcome
from daq.run_plan import PulsePair, RunKind, RunPlan
from processing.synthetic.truth_file import read_true_cameras
from server.lab.duty import Health
from server.lab.monitor import RigMonitor
from server.rig.assembly import AssembledRig, open_generator, open_rig
from server.rig.config import RigConfig, load_config
from server.rig.far_end_guest import FarEndGuest
from server.rig.rig_lock import far_end_address, far_end_port
from server.rig.shared_door import SharedDoor
from server.rig.simulated_operator import TRUTH_FILE

pytestmark = pytest.mark.network
ROOT = Path(__file__).parents[3]
CONFIG = ROOT / "configs" / "simulated_small.toml"
LIMIT_S = 60.0
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}
COMMAND = [sys.executable, "-m", "server.cli", "simulate", "--config", str(CONFIG)]


@pytest.fixture(scope="module")
def config() -> RigConfig:
    return load_config(CONFIG)


@contextmanager
def simulator() -> Iterator[subprocess.Popen[str]]:
    """``tomoshadow simulate`` in a process of its own, ready."""
    process = subprocess.Popen(COMMAND, env=ENVIRONMENT, stderr=subprocess.PIPE, text=True)
    with process:
        try:
            said = ""
            while "its far ends run in process" not in said:
                said = heard(process)
            yield process
        finally:
            process.terminate()


def heard(process: subprocess.Popen[str]) -> str:
    assert process.stderr is not None
    said = process.stderr.readline()
    assert said, f"ended with {process.wait(LIMIT_S)}"
    return said


def plan(config: RigConfig, shots: int = 1) -> RunPlan:
    current_a = {name: view.nominal_current_a for name, view in config.views.items()}
    return RunPlan(name="test", kind=RunKind.BACKGROUND, shots=shots, rate_hz=10, pulse=PulsePair(current_a=current_a))


def record(opened: AssembledRig, config: RigConfig, data_dir: Path) -> Path:
    """Record one shot; the directory of the run."""
    limits = AcquisitionLimits(frame_s=10)
    with Acquisition(opened.rig, data_dir, limits=limits, observers=opened.observers) as acquisition:
        run_id = acquisition.start(plan(config))
        status = acquisition.wait(LIMIT_S)
    assert (status.outcome, status.shots_valid) == (RunOutcome.COMPLETED, 1), status.message
    return data_dir / run_id


def eventually(is_so: Callable[[], bool], what: str) -> None:
    end_s = time.monotonic() + LIMIT_S
    while not is_so():
        assert time.monotonic() < end_s, f"waited {LIMIT_S} s until {what}"
        time.sleep(0.02)


def pulse_generator_of(process: subprocess.Popen[str]) -> int:
    """Its firmware is the only child of the simulator."""
    (child,) = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    return int(child)


def lamp_of(monitor: RigMonitor) -> tuple[Health, str]:
    """Of the far ends, now."""
    asyncio.run(monitor.ask())
    lamp = monitor.lamps[-1]
    assert lamp.name == "far ends"
    return lamp.health, lamp.detail


def recovered(ask: Callable[[], object], recover: Callable[[], None]) -> bool:
    """Do what a server does with a device that was lost."""
    try:
        ask()
    except DeviceError:
        with suppress(DeviceError):
            recover()
        return False
    return True


def test_far_ends_outlive_who_works_with_them_and_leave_nothing_behind(config: RigConfig, tmp_path: Path) -> None:
    with simulator() as process:
        fired = []
        for _ in range(2):
            with open_rig(config) as opened:
                run_dir = record(opened, config, tmp_path)
                fired.append(opened.rig.generator.status().counters["fired"])
                assert opened.rig.interlock.identity().model != "", "the interlock is the same as without them"
            assert set(read_true_cameras(run_dir / TRUTH_FILE)) == set(config.views)
        assert fired == [1, 2], "the same pulse generator"
        with open_generator(config) as generator:
            assert generator.status().counters["fired"] == 2
        firmware = pulse_generator_of(process)
        process.send_signal(signal.SIGINT)
        assert process.wait(LIMIT_S) == 0
    assert not Path(f"/proc/{firmware}").exists()
    for device in ("pulse_generator", "stage"):
        assert not far_end_port(config, device).is_symlink()
    with closing(socket.socket(socket.AF_UNIX)) as nobody, pytest.raises(ConnectionRefusedError):
        nobody.connect(far_end_address(config))


def test_door_and_faults_reach_far_ends_of_another_process(config: RigConfig) -> None:
    with simulator() as process, open_rig(config) as opened:
        rig, laboratory = opened.rig, opened.laboratory
        assert laboratory is not None
        eventually(rig.interlock.is_closed, "the door is closed")
        laboratory.open_door()
        assert rig.interlock.wait_for_change(LIMIT_S)
        assert not rig.interlock.is_closed()
        assert not rig.generator.status().interlock_closed
        laboratory.close_door()
        eventually(rig.interlock.is_closed, "the door is closed again")
        with pytest.raises(ValueError, match="there is no view view9"):
            laboratory.inject(Fault(kind=FaultKind.FROZEN, view="view9"))
        laboratory.inject(Fault(kind=FaultKind.KILLED, view="view1", duration_s=0.0))
        firmware = pulse_generator_of(process)
        os.kill(firmware, signal.SIGKILL)
        assert f"the pulse generator, process {firmware}, had died: it is plugged in again" in heard(process)
        generator = rig.generator
        eventually(lambda: recovered(generator.status, generator.recover), "the driver has the new one")


def test_second_ones_are_refused_by_name_and_another_rig_file_too(config: RigConfig) -> None:
    with simulator() as process:
        second = subprocess.run(COMMAND, env=ENVIRONMENT, capture_output=True, text=True, timeout=LIMIT_S, check=False)
        assert second.returncode == 1
        assert "far end of camera 127.0.2.1 of network" in second.stderr
        assert f"is held by process {process.pid}, since" in second.stderr
        assert config.simulation is not None
        other = config.model_copy(update={"simulation": config.simulation.model_copy(update={"seed": 7})})
        text = rf"run in process {process.pid}, .* another rig file \(simulation\.seed: 1 there, 7 here\)"
        with pytest.raises(AlreadyHeld, match=text), FarEndGuest(other, SharedDoor()):
            pass


def test_a_simulator_that_dies_is_named_and_its_successor_taken(
    config: RigConfig, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with ExitStack() as simulators:
        first = simulators.enter_context(simulator())
        opened = simulators.enter_context(open_rig(config))
        record(opened, config, tmp_path)
        assert opened.laboratory is not None
        monitor = RigMonitor(opened.rig, tmp_path, laboratory=opened.laboratory)
        assert lamp_of(monitor) == (Health.OK, f"process {first.pid}")
        first.kill()
        first.wait(LIMIT_S)
        health, detail = lamp_of(monitor)
        assert health is Health.FAULT
        assert "start them again (tomoshadow simulate --config" in detail
        eventually(lambda: not opened.rig.interlock.is_closed(), "a door that nobody can tell about is open")
        assert "those of rig 'simulated spray4view, binned' do not answer" in caplog.text
        with pytest.raises(DeviceUnavailable, match=r"start them again \(tomoshadow simulate"):
            opened.laboratory.open_door()
        with pytest.raises(DaqError):
            record(opened, config, tmp_path / "refused")
        with simulator() as second:
            assert lamp_of(monitor) == (Health.OK, f"process {second.pid}")
            eventually(opened.rig.interlock.is_closed, "the door of the new one is closed")
            generator, stage = opened.rig.generator, opened.rig.stage
            assert stage is not None
            eventually(lambda: recovered(generator.status, generator.recover), "the generator is found again")
            eventually(lambda: recovered(stage.position_mm, stage.recover), "the stage is found again")
            record(opened, config, tmp_path)
            simulators.close()


def test_a_real_rig_has_its_own_far_ends() -> None:
    command = [*COMMAND[:-1], str(ROOT / "configs" / "spray4view.toml")]
    refused = subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    assert refused.returncode == 2
    assert "spray4view.toml: has no [simulation]" in refused.stderr
