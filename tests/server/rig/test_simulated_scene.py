"""The views of a simulated rig are imperfect in a known way, and the truth of them is kept."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from daq.errors import DeviceError
from daq.run_plan import PulsePair, RunKind, RunPlan
from daq.shot import FiredTrain, LightPulse
from daq.simulation.camera.light import CollectedPulse, Exposure
from daq.timing import Window
from processing.synthetic.truth_file import TruthFileError, read_true_cameras, read_true_spray
from server.rig.config import RigConfig, load_config
from server.rig.simulated_operator import TRUTH_FILE, SimulatedOperator
from server.rig.simulated_scene import SimulatedScene, true_cameras


@pytest.fixture(scope="module")
def small() -> RigConfig:
    return load_config(Path("configs/simulated_small.toml"))


def exposure(view: str = "view2", pulses: int = 1) -> Exposure:
    light = tuple(CollectedPulse(5000, 1000, 9.9) for _ in range(pulses))
    return Exposure(view, 1, "A", Window(1000, 9000), light, (300, 400), 8)


def test_distortion_is_a_few_pixels_in_the_corners() -> None:
    config = load_config(Path("configs/simulated.toml"))
    for camera in true_cameras(config, seed=1).values():
        corners_px = np.array([[0.0, 0.0], [1599.0, 0.0], [0.0, 1199.0], [1599.0, 1199.0]])
        shifts_px = np.linalg.norm(camera.undistort(corners_px) - corners_px, axis=1)
        assert 0.3 < shifts_px.max() < 6


def test_every_view_sees_the_origin_in_the_middle_at_60_px_per_mm() -> None:
    config = load_config(Path("configs/simulated.toml"))
    for name, camera in true_cameras(config, seed=1).items():
        origin_px, beside_px = camera.project(np.array([[0.0, 0, 0], [0.0, 1.0, 0]]))
        np.testing.assert_allclose(origin_px, [799.5, 599.5], atol=3, err_msg=name)
        assert np.linalg.norm(beside_px - origin_px) == pytest.approx(60, abs=2)


def test_the_seed_decides_how_the_cameras_stand() -> None:
    config = load_config(Path("configs/simulated.toml"))
    one, again, other = (true_cameras(config, seed)["view1"] for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.distortion, again.distortion)
    assert np.any(one.rotation != other.rotation)


def test_a_camera_hangs_as_the_configuration_says(small: RigConfig) -> None:
    view = small.views["view1"].model_copy(update={"roll_deg": 180.0})
    upright, hanging = (
        true_cameras(small.model_copy(update={"views": {"view1": one}}), seed=1)["view1"]
        for one in (small.views["view1"], view)
    )
    np.testing.assert_allclose(hanging.rotation[:2], -upright.rotation[:2], atol=1e-12)


def test_the_target_stands_where_the_stage_is(small: RigConfig) -> None:
    height_mm = [0.0]
    scene, fixed = SimulatedScene(small, lambda: height_mm[0]), SimulatedScene(small, lambda: 2.0)
    scene.prepare(RunKind.CALIBRATION)
    fixed.prepare(RunKind.CALIBRATION)
    assert np.any(scene.expose(exposure()) != fixed.expose(exposure()))
    height_mm[0] = 2.0
    np.testing.assert_array_equal(scene.expose(exposure()), fixed.expose(exposure()))


def test_without_light_it_is_dark_and_twice_the_light_is_twice_as_bright(small: RigConfig) -> None:
    scene = SimulatedScene(small, lambda: 0.0)
    scene.prepare(RunKind.BACKGROUND)
    none, one, two = (float(np.median(scene.expose(exposure(pulses=count)))) for count in range(3))
    assert none < 8
    assert two - none == pytest.approx(2 * (one - none), rel=0.1) or two == 255


def test_where_nothing_moves_the_truth_is_what_every_shot_shows(small: RigConfig) -> None:
    assert small.simulation is not None
    still = small.model_copy(update={"simulation": small.simulation.model_copy(update={"still": True})})
    scene = SimulatedScene(still, lambda: 0.0)
    scene.prepare(RunKind.SAMPLE)
    first, later = (scene.expose(replace(exposure(), sequence=sequence)) for sequence in (3, 8))
    np.testing.assert_array_equal(later, first)
    true, still_true = (scene.liquid(FiredTrain(sequence)).spray.positions_mm for sequence in (3, 8))
    np.testing.assert_array_equal(still_true, true)


def plan(small: RigConfig, kind: RunKind) -> RunPlan:
    current_a = {name: view.nominal_current_a for name, view in small.views.items()}
    return RunPlan(name="test", kind=kind, shots=1, pulse=PulsePair(current_a=current_a))


def test_the_truth_is_the_liquid_at_the_middle_of_the_first_pulse(small: RigConfig, tmp_path: Path) -> None:
    operator = SimulatedOperator(SimulatedScene(small, lambda: 0.0))
    operator.before_run(plan(small, RunKind.SAMPLE), tmp_path)
    light = {"view1": (LightPulse(5552, 1000, 25.0), LightPulse(11952, 1000, 25.0)), "view2": ()}
    for train in (FiredTrain(7, {}, light), FiredTrain(8, {}, {})):
        operator.on_fired(train)
    operator.after_run(tmp_path)
    fired, unlit = (read_true_spray(tmp_path / TRUTH_FILE, sequence) for sequence in (7, 8))
    assert (fired.time_ns, unlit.time_ns) == (6052, 0)
    assert len(fired.spray) > 1000
    assert set(read_true_cameras(tmp_path / TRUTH_FILE)) == set(small.views)


def test_the_truth_is_there_while_the_run_goes_on(small: RigConfig, tmp_path: Path) -> None:
    operator = SimulatedOperator(SimulatedScene(small, lambda: 0.0))
    operator.before_run(plan(small, RunKind.SAMPLE), tmp_path)
    operator.on_fired(FiredTrain(7))
    end_s = time.monotonic() + 20
    while not list(tmp_path.glob("truth/sprays/7.h5")):
        assert time.monotonic() < end_s
        time.sleep(0.01)
    assert len(read_true_spray(tmp_path / TRUTH_FILE, 7).spray) > 1000


def test_runs_without_spray_keep_their_cameras_only(small: RigConfig, tmp_path: Path) -> None:
    operator = SimulatedOperator(SimulatedScene(small, lambda: 0.0))
    operator.before_run(plan(small, RunKind.CALIBRATION), tmp_path)
    operator.on_fired(FiredTrain(7))
    operator.after_run(tmp_path)
    assert len(read_true_cameras(tmp_path / TRUTH_FILE)) == 4
    with pytest.raises(TruthFileError, match="no spray of firing 7"):
        read_true_spray(tmp_path / TRUTH_FILE, 7)


def test_a_truth_that_cannot_be_written_is_named(small: RigConfig, tmp_path: Path) -> None:
    operator = SimulatedOperator(SimulatedScene(small, lambda: 0.0))
    operator.before_run(plan(small, RunKind.SAMPLE), tmp_path)
    (tmp_path / "truth" / "sprays").write_text("no folder")
    operator.on_fired(FiredTrain(7))
    with pytest.raises(DeviceError, match=r"truth\.h5: the truth is not complete: .*sprays"):
        operator.after_run(tmp_path)


def test_a_run_that_nobody_has_ended_is_over_when_the_next_one_begins(small: RigConfig, tmp_path: Path) -> None:
    operator = SimulatedOperator(SimulatedScene(small, lambda: 0.0))
    for name in ("lost", "next"):
        operator.before_run(plan(small, RunKind.SAMPLE), tmp_path / name)
    operator.on_fired(FiredTrain(9))
    operator.after_run(tmp_path / "lost")
    operator.after_run(tmp_path / "next")
    assert len(read_true_spray(tmp_path / "next" / TRUTH_FILE, 9).spray) > 1000


def test_a_real_rig_has_no_scene() -> None:
    with pytest.raises(ValueError, match=r"rig spray4view: has no \[simulation\]"):
        SimulatedScene(load_config(Path("configs/spray4view.toml")), lambda: 0.0)
