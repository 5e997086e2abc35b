"""Droplets tell which view has moved, and by how much; where they cannot, nobody guesses."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from processing.calibration.calibration import Model
from processing.calibration.calibration_file import load_calibration, save_calibration
from processing.calibration.droplets.mapping_correction import corrected, correction_size, sensitivity
from processing.calibration.droplets.self_calibration import SelfCalibration, self_calibrate
from processing.calibration.errors import CalibrationError
from processing.calibration.fit.polynomial import fit_polynomial
from processing.calibration.verdict import Doubt, Verdict, doubt_of_shot
from processing.geometry import FloatArray, PinholeCamera, ViewMapping
from processing.studies.drifting_views import direction
from tests.support.drifting_views import HALF_MM, SIZE_PX, calibration_of, droplet_shots, inside_mm, views

Drift = Callable[[FloatArray], FloatArray]
SHOTS = 4


def shifted(u_px: float, v_px: float) -> Drift:
    return lambda image_px: image_px + (u_px, v_px)


def rolled(angle_rad: float) -> Drift:
    centre_px = np.array(SIZE_PX) / 2
    turn = np.array([[np.cos(angle_rad), np.sin(angle_rad)], [-np.sin(angle_rad), np.cos(angle_rad)]])
    return lambda image_px: (image_px - centre_px) @ turn + centre_px


def recalibrate(
    drifts: dict[int, Drift], mappings: list[ViewMapping] | None = None, doubts: tuple[Doubt, ...] = ()
) -> SelfCalibration:
    """Calibrated before the drifts, shots taken after them."""
    drifted = [
        tuple(drifts[view](points_px) if view in drifts else points_px for view, points_px in enumerate(shot))
        for shot in droplet_shots(SHOTS)
    ]
    model = Model.PINHOLE if mappings is None else Model.POLYNOMIAL
    return self_calibrate(calibration_of(mappings or views(), model).doubted(doubts), drifted, "run-7")


def errors_px(result: SelfCalibration, drifts: dict[int, Drift]) -> FloatArray:
    """Largest distance from the truth in the volume, by view."""
    points_mm = inside_mm()
    worst = []
    for view, (camera, found) in enumerate(zip(views(), result.calibration.views.values(), strict=True)):
        true_px = camera.project(points_mm)
        true_px = drifts[view](true_px) if view in drifts else true_px
        worst.append(np.linalg.norm(found.mapping.project(points_mm) - true_px, axis=1).max())
    return np.array(worst)


@pytest.mark.parametrize("view", range(4))
def test_drift_of_any_one_view_is_recovered(view: int) -> None:
    drifts = {view: shifted(*(2.0 * direction(view)))}
    result = recalibrate(drifts)
    assert result.moved == f"view{view + 1}"
    assert errors_px(result, drifts).max() < 0.1
    assert result.corrections_px[f"view{view + 1}"] == pytest.approx(2.0, abs=0.1)
    assert result.before_px[f"view{view + 1}"] == pytest.approx(2.0, abs=0.1)
    assert max(result.after_px.values()) < 0.1


def test_views_that_did_not_move_stay_exactly() -> None:
    result = recalibrate({0: shifted(2.0, 0.0)})
    assert {name for name, distance_px in result.corrections_px.items() if distance_px} == {"view1"}
    parent = calibration_of(views())
    for name in ("view2", "view3", "view4"):
        assert result.calibration.views[name].mapping is not parent.views[name].mapping
        np.testing.assert_array_equal(
            result.calibration.views[name].mapping.project(inside_mm()), parent.views[name].mapping.project(inside_mm())
        )


def test_rolled_camera_is_recovered() -> None:
    drifts = {2: rolled(0.01)}
    result = recalibrate(drifts)
    assert result.moved == "view3"
    assert errors_px(result, drifts).max() < 0.1


def test_polynomial_mapping_is_corrected_too() -> None:
    x, y, z = np.meshgrid(np.linspace(-2.6, 2.6, 9), np.linspace(-2.1, 2.1, 8), np.linspace(-1.6, 1.6, 5))
    points_mm = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    mappings = [fit_polynomial(points_mm, camera.project(points_mm), SIZE_PX)[0] for camera in views()]
    drifts = {1: shifted(-2.0, 0.5)}
    result = recalibrate(drifts, list(mappings))
    assert result.moved == "view2"
    assert errors_px(result, drifts).max() < 0.1


def test_views_that_all_moved_agree_again_around_the_old_world() -> None:
    drifts = {0: shifted(0.0, 0.8), 1: shifted(0.0, -0.7), 2: shifted(0.0, 0.6), 3: shifted(0.0, -0.9)}
    result = recalibrate(drifts)
    assert result.moved is None
    assert max(result.after_px.values()) < 0.1
    assert max(result.before_px.values()) > 0.8
    signs = [np.sign(float(drift(np.zeros((1, 2)))[0, 1])) for drift in drifts.values()]
    points_mm, parent = inside_mm(), views()
    for sign, before, after in zip(signs, parent, result.calibration.views.values(), strict=True):
        assert sign * (after.mapping.project(points_mm) - before.project(points_mm))[:, 1].mean() > 0.3


def test_good_calibration_hardly_changes() -> None:
    result = recalibrate({})
    assert max(result.corrections_px.values()) == 0.0
    assert result.calibration.notes[-1].endswith("the views agree, nothing moved")


@pytest.mark.parametrize("moves", [True, False])
def test_what_droplets_said_ends_with_the_correction_and_what_the_target_said_stays(moves: bool) -> None:
    said = doubt_of_shot(("view1", "view2"), 0, "run-6", "droplets are seen 2 px beside", Verdict.WARN)
    other = Doubt(("view2",), "its scale is another one than the rig's", Verdict.WARN)
    result = recalibrate({0: shifted(2.0, 0.0)} if moves else {}, doubts=(said, other))
    first, second = (result.calibration.views[name] for name in ("view1", "view2"))
    assert (said.text in first.reasons, said.text in second.reasons) == (not moves, not moves)
    assert (first.verdict is Verdict.WARN) is not moves
    assert other.text in second.reasons
    assert second.verdict is Verdict.WARN


def test_new_file_names_its_parent(tmp_path: Path) -> None:
    result = recalibrate({3: shifted(1.0, 1.0)})
    parent = calibration_of(views())
    assert result.calibration.parent == parent.id != result.calibration.id
    assert "self-calibration on 4 exposures of run-7: view4 by 1.4" in result.calibration.notes[-1]
    save_calibration(result.calibration, tmp_path / "new.json")
    read = load_calibration(tmp_path / "new.json")
    assert (read.parent, read.id) == (parent.id, result.calibration.id)
    save_calibration(parent, tmp_path / "old.json")
    assert "parent" not in (tmp_path / "old.json").read_text()
    assert load_calibration(tmp_path / "old.json").parent is None


def test_too_few_droplets_are_refused() -> None:
    sparse = [tuple(points_px[:15] for points_px in shot) for shot in droplet_shots(SHOTS)]
    with pytest.raises(
        CalibrationError,
        match=r"\d of 27 sub-volumes, 8 are needed: 4 exposures with 15, 15.*take more shots; if",
    ):
        self_calibrate(calibration_of(views()), sparse, "run")


def test_what_is_left_uncertain_is_refused() -> None:
    """A few droplets, seen badly: enough sub-volumes, but the correction would be wrong by 0.3 px."""
    rng = np.random.default_rng(1)
    shots = []
    for _ in range(SHOTS):
        points_mm = rng.uniform(-HALF_MM, HALF_MM, (90, 3))
        shot = [camera.project(points_mm) + rng.normal(0, 0.18, (90, 2)) for camera in views()]
        shots.append([shot[0] + 2.0 * direction(0), *shot[1:]])
    with pytest.raises(
        CalibrationError,
        match=r"1\d\d droplets in \d+ sub-volumes leave .* uncertain by 0\.\d+ px, at most 0\.06 px.*more shots",
    ):
        self_calibrate(calibration_of(views()), shots, "run")


def test_uncertainty_is_that_of_the_error() -> None:
    drifts = {1: shifted(*(2.0 * direction(1)))}
    result = recalibrate(drifts)
    assert 0.01 < result.uncertainty_px < 0.06
    assert errors_px(result, drifts).max() < 3 * result.uncertainty_px
    assert recalibrate({}).uncertainty_px == 0.0


def test_droplets_that_have_nothing_to_do_with_each_other_are_refused() -> None:
    first, *others = droplet_shots(SHOTS)
    mixed = [(shot[0], first[1], shot[2], others[0][3]) for shot in others[1:]]
    with pytest.raises(CalibrationError, match="sub-volumes"):
        self_calibrate(calibration_of(views()), mixed, "run")


def test_two_views_are_refused() -> None:
    pairs = [shot[:2] for shot in droplet_shots(SHOTS)]
    with pytest.raises(CalibrationError, match="2 views cannot check each other, at least 3"):
        self_calibrate(calibration_of(views()[:2]), pairs, "run")


@pytest.mark.parametrize("element", range(6))
def test_corrections_of_a_camera_are_small_and_smooth(element: int) -> None:
    camera, points_mm = views()[0], inside_mm(50)
    correction = np.zeros(correction_size(camera))
    correction[element] = 1.0
    moved = corrected(camera, correction)
    assert isinstance(moved, PinholeCamera)
    np.testing.assert_allclose(moved.rotation @ moved.rotation.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(
        moved.project(points_mm) - camera.project(points_mm),
        sensitivity(camera, points_mm)[:, :, element],
        atol=2e-3,
    )
    assert np.linalg.norm(moved.project(points_mm) - camera.project(points_mm), axis=1).max() < 1.2
