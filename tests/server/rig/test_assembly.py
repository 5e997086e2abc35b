"""The assembled simulated rig: real drivers at one end of every wire, light and faults at the other."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest

from daq.devices import GeneratorState
from daq.errors import DeviceRefused, DeviceUnavailable
from daq.faults import Fault, FaultKind, ScriptedFault
from daq.run_plan import PulsePair, RunKind, RunPlan
from daq.shot import DoubleFrame
from daq.simulation.gpio_chip import ChipUnsupported, SimulatedSwitchLine, free_line
from daq.simulation.laboratory import SimulatedLaboratory
from daq.timing import plan_shot_timing
from processing.synthetic.truth_file import read_true_spray
from server.rig.assembly import AssembledRig, open_rig, recorded_configuration
from server.rig.config import RigConfig, SimulationConfig, load_config

pytestmark = pytest.mark.network
FRAME_S = 1.5
"""In which all frames have come on a busy machine; the generator hears nothing meanwhile, and waits for 3 s."""


def small(simulation: SimulationConfig) -> RigConfig:
    """The small simulated rig with faults and interlock of the test's own."""
    return load_config(Path("configs/simulated_small.toml")).model_copy(update={"simulation": simulation})


def elsewhere(config: RigConfig) -> RigConfig:
    """The same rig at other addresses: those of ``assembled`` are held."""
    views = {
        name: view.model_copy(update={"camera": view.camera.model_copy(update={"ip": f"127.0.5.{number}"})})
        for number, (name, view) in enumerate(config.views.items(), 1)
    }
    return config.model_copy(update={"views": views})


def test_a_run_keeps_what_its_cameras_are_told_and_not_only_where_that_was_written(tmp_path: Path) -> None:
    config = small(SimulationConfig())
    profile = tmp_path / "camera.toml"
    text = config.views["view1"].camera.profile.read_text()
    profile.write_text(text.replace("exposure_b_ns = 30_000_000", "exposure_b_ns = 31_000_000"))
    camera = config.views["view1"].camera.model_copy(update={"profile": profile})
    views = {**config.views, "view1": config.views["view1"].model_copy(update={"camera": camera})}
    told = recorded_configuration(config.model_copy(update={"views": views}))["camera_profiles"]
    assert {name: one["timing"]["exposure_b_ns"] for name, one in told.items()} == {
        name: 31_000_000 if name == "view1" else 30_000_000 for name in config.views
    }
    assert {"feature": "ExposureMode", "value": "DoubleFrame", "tolerance": 0.0} in told["view2"]["features"]


@pytest.fixture(scope="module")
def assembled() -> Iterator[AssembledRig]:
    with open_rig(small(SimulationConfig())) as opened:
        yield opened


def plan(assembled: AssembledRig, kind: RunKind = RunKind.BACKGROUND) -> RunPlan:
    currents = {"view1": 25.0, "view2": 9.9, "view3": 10.0, "view4": 26.0}
    return RunPlan(name="test", kind=kind, shots=1, pulse=PulsePair(current_a=currents))


def shoot(
    assembled: AssembledRig,
    *faults: Fault,
    shots: int = 1,
    kind: RunKind = RunKind.BACKGROUND,
    run_dir: Path | None = None,
) -> list[Mapping[str, DoubleFrame]]:
    """Arm everything, fire, collect, disarm; faults happen before the first shot."""
    rig, laboratory = assembled.rig, assembled.laboratory
    assert laboratory is not None
    rig.generator.off()
    rig.generator.configure(
        plan_shot_timing(plan(assembled), {name: camera.timing for name, camera in rig.cameras.items()})
    )
    if run_dir is not None:
        (operator,) = assembled.observers
        operator.before_run(plan(assembled, kind), run_dir)
    for camera in rig.cameras.values():
        camera.arm()
    for fault in faults:
        laboratory.inject(fault)
    try:
        rig.generator.arm(shots)
        return [fire(assembled) for _ in range(shots)]
    finally:
        rig.generator.off()
        for camera in rig.cameras.values():
            camera.disarm()


def fire(assembled: AssembledRig) -> Mapping[str, DoubleFrame]:
    cameras = assembled.rig.cameras
    for camera in cameras.values():
        camera.begin_shot()
    assembled.rig.generator.fire()
    return {name: camera.collect(FRAME_S) for name, camera in cameras.items()}


def test_every_device_is_the_real_driver_and_names_itself(assembled: AssembledRig) -> None:
    rig = assembled.rig
    assert rig.stage is not None
    devices = [*rig.cameras.values(), rig.generator, rig.interlock, rig.stage]
    modules = {type(device).__module__ for device in devices}
    assert modules <= {
        "daq.drivers.aravis_camera",
        "daq.drivers.serial_pulse_generator",
        "daq.drivers.gpio_interlock",
        "daq.drivers.serial_stage",
        "daq.simulation.interlock",
    }
    assert [device.name for device in devices] == [*rig.cameras, "pulse_generator", "interlock", "stage"]
    assert all(device.identity().model for device in devices)


def test_a_shot_lights_all_exposures(assembled: AssembledRig) -> None:
    (views,) = shoot(assembled)
    for name, frames in views.items():
        assert frames.valid, name
        assert frames.frame_b is not None
        assert 90 < np.median(frames.frame_a) < 170
        assert 90 < np.median(frames.frame_b) < 170


def test_a_lost_pulse_leaves_b_of_its_view_dark(assembled: AssembledRig) -> None:
    (views,) = shoot(assembled, Fault(kind=FaultKind.PULSE_B_LOST, view="view2"))
    lit = {name: bool(np.median(frames.frame_b) > 50) for name, frames in views.items() if frames.frame_b is not None}
    assert lit == {"view1": True, "view2": False, "view3": True, "view4": True}
    assert np.median(views["view2"].frame_a) > 50


def test_a_pulse_that_comes_beyond_exposure_b_is_lost(assembled: AssembledRig) -> None:
    (views,) = shoot(assembled, Fault(kind=FaultKind.PULSE_B_LATE, view="view3", amount=40_000))
    assert views["view3"].frame_b is not None
    assert np.median(views["view3"].frame_b) < 20


def test_a_dropped_exposure_is_flagged_and_the_next_shot_is_whole(assembled: AssembledRig) -> None:
    first, second = shoot(assembled, Fault(kind=FaultKind.DROPPED_B, view="view1"), shots=2)
    assert not first["view1"].record_b.valid
    assert all(frames.valid for frames in second.values())


def test_the_door_reaches_computer_and_generator(assembled: AssembledRig) -> None:
    rig, laboratory = assembled.rig, assembled.laboratory
    assert laboratory is not None
    assert rig.interlock.is_closed()
    laboratory.open_door()
    try:
        assert rig.interlock.wait_for_change(1.0)
        assert not rig.interlock.is_closed()
        status = rig.generator.status()
        assert not status.interlock_closed
        assert status.state is not GeneratorState.ARMED
        with pytest.raises(DeviceRefused):
            rig.generator.arm(1)
    finally:
        laboratory.close_door()
        rig.generator.clear()
    assert rig.interlock.is_closed()
    assert rig.generator.status().interlock_closed


def test_the_truth_of_fired_sprays_is_kept(assembled: AssembledRig, tmp_path: Path) -> None:
    before = assembled.rig.generator.status().counters["fired"]
    shoot(assembled, shots=2, kind=RunKind.SAMPLE, run_dir=tmp_path)
    (operator,) = assembled.observers
    operator.after_run(tmp_path)
    path = tmp_path / "truth" / "truth.h5"
    for sequence in (before + 1, before + 2):
        assert len(read_true_spray(path, sequence).spray) > 1000


def test_a_fault_of_an_unknown_view_is_refused(assembled: AssembledRig) -> None:
    assert assembled.laboratory is not None
    with pytest.raises(ValueError, match="there is no view view9"):
        assembled.laboratory.inject(Fault(kind=FaultKind.FROZEN, view="view9"))


def test_scripted_faults_happen_at_their_firing_and_the_light_ends_with_the_rig() -> None:
    script = (
        ScriptedFault(sequence=2, kind=FaultKind.DROPPED_A, view="view4"),
        ScriptedFault(sequence=3, kind=FaultKind.INTERLOCK_OPEN),
    )
    with open_rig(elsewhere(small(SimulationConfig(gpio="memory", faults=script)))) as opened:
        assert type(opened.rig.interlock).__name__ == "MemoryInterlock"
        first, second, _ = shoot(opened, shots=3)
        assert all(frames.valid for frames in first.values())
        assert [name for name, frames in second.items() if not frames.valid] == ["view4"]
        opened.rig.interlock.wait_for_change(2.0)
        assert not opened.rig.interlock.is_closed()
        assert isinstance(opened.laboratory, SimulatedLaboratory)
        generator = opened.laboratory.devices.generator.pid
    assert not Path(f"/proc/{generator}").exists()


def test_the_gpio_chip_is_used_where_the_machine_can_have_one(assembled: AssembledRig) -> None:
    try:
        SimulatedSwitchLine(free_line())  # that of ``assembled`` would be cut
    except ChipUnsupported as reason:
        pytest.skip(str(reason))
    assert assembled.rig.interlock.identity().serial.startswith("gpiochip-simulated line")


def test_a_real_rig_that_is_not_there_is_named() -> None:
    with (
        pytest.raises(DeviceUnavailable, match="stage: port /dev/ttyUSB0"),
        open_rig(load_config(Path("configs/spray4view.toml"))),
    ):
        pass
