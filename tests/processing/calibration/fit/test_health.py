"""A calibration is judged by what it has not seen."""

from collections.abc import Sequence

import numpy as np
import pytest

from processing.calibration.calibrate import calibrate
from processing.calibration.errors import CalibrationError
from processing.calibration.fit.health import (
    LIMITS_PX,
    check_motion,
    degeneracy,
    errors_px,
    holdout_distances_px,
    judge,
    outline_mm,
    plane_error,
)
from processing.calibration.observation import PlaneObservation
from processing.geometry import PinholeCamera
from tests.support.calibration_cases import calibration_set, paper_camera, seen_planes, target_plane_mm


def shifted(
    plane: PlaneObservation, *, px: tuple[float, float] = (0.0, 0.0), mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> PlaneObservation:
    return PlaneObservation(plane.name, plane.points_mm + mm, plane.image_px + px, plane.z_mm)


@pytest.mark.parametrize(
    ("error_px", "verdict"),
    [
        (0.0, "good"),
        (0.05, "good"),
        (0.051, "usable"),
        (0.3, "usable"),
        (0.31, "warn"),
        (0.8, "warn"),
        (0.81, "refuse"),
    ],
)
def test_verdict_follows_the_holdout_error(error_px: float, verdict: str) -> None:
    assert judge(error_px) == verdict
    assert list(LIMITS_PX.values()) == sorted(LIMITS_PX.values())


def test_many_rejected_points_cost_the_good_verdict() -> None:
    assert judge(0.01, rejected=0.05) == "good"
    assert judge(0.01, rejected=0.2) == "warn"
    assert judge(2.0, rejected=0.2) == "refuse"


def test_error_is_the_distance_of_equation_2() -> None:
    camera = paper_camera()
    plane = shifted(seen_planes(camera, z_mm=(1.0,), noise_px=0)[0], px=(0.3, -0.4))
    distances_px = errors_px(camera, plane)
    np.testing.assert_allclose(distances_px, 0.5, atol=1e-9)
    summary = plane_error(plane, np.array([0.0, 1.0]), np.array([0.5, 1.0]))
    assert (summary.mean_error_px, summary.max_error_px, summary.name) == (0.5, 1.0, "z=1")
    assert summary.holdout_error_px == 0.75
    assert summary.rms_px == pytest.approx(np.sqrt(0.5))


def test_the_fit_never_sees_what_it_is_judged_by() -> None:
    planes = seen_planes(paper_camera())
    seen: list[set[str]] = []

    def fit(training: Sequence[PlaneObservation]) -> PinholeCamera:
        seen.append({plane.name for plane in training})
        return paper_camera()

    distances_px = holdout_distances_px(planes, fit)
    assert [len(distance_px) for distance_px in distances_px] == [391] * 10
    held_out = [{plane.name for plane in planes} - names for names in seen]
    assert all(held_out)
    assert sorted(name for names in held_out for name in names) == sorted(plane.name for plane in planes)


def test_single_points_are_held_out_where_there_are_few_planes() -> None:
    planes = seen_planes(paper_camera(), z_mm=(-2.0, 0.0, 2.0))
    sizes: list[int] = []

    def fit(training: Sequence[PlaneObservation]) -> PinholeCamera:
        sizes.append(sum(len(plane) for plane in training))
        assert len(training) == 3
        return paper_camera()

    error_px = np.concatenate(holdout_distances_px(planes, fit)).mean()
    total = sum(len(plane) for plane in planes)
    assert sum(total - size for size in sizes) == total
    assert error_px == pytest.approx(0.05 * np.sqrt(np.pi / 2), rel=0.1)


def test_overfitting_shows_in_the_holdout_error_only() -> None:
    rng = np.random.default_rng(1)
    few = tuple(
        PlaneObservation(f"z={z}", points_mm, paper_camera().project(points_mm) + rng.normal(0, 0.3, (6, 2)), z)
        for z in (-4.0, -1.0, 1.0, 4.0)
        for points_mm in [target_plane_mm(z)[rng.choice(391, 6, replace=False)]]
    )
    view = calibrate(calibration_set(only=few)).views["only"]
    assert view.holdout_error_px > 1.5 * view.mean_error_px


def test_a_stage_that_lied_about_one_position_is_found() -> None:
    planes = list(seen_planes(paper_camera(), noise_px=0.02))
    planes[3] = shifted(planes[3], mm=(0, 0, 0.01))
    honest = seen_planes(paper_camera(-45.0), noise_px=0.02)
    calibration = calibrate(calibration_set(honest=honest, lying=tuple(planes)))
    lying = calibration.views["lying"]
    assert lying.holdout_error_px > 2 * calibration.views["honest"].holdout_error_px
    assert lying.worst_plane.name == planes[3].name
    assert lying.worst_plane.mean_error_px > 0.3
    assert lying.verdict == "usable"


@pytest.mark.parametrize("z_mm", [(-4.0, -2.0, 0.0, 2.0, 4.0), (-3.0, 0.0, 3.0)])
def test_errors_are_told_plane_by_plane(z_mm: tuple[float, ...]) -> None:
    view = calibrate(calibration_set(only=seen_planes(paper_camera(), z_mm=z_mm))).views["only"]
    weights = [plane.n_points for plane in view.planes]
    holdout_px = [plane.holdout_error_px for plane in view.planes if plane.holdout_error_px is not None]
    assert np.average(holdout_px, weights=weights) == pytest.approx(view.holdout_error_px)
    largest_px = [plane.max_error_px for plane in view.planes if plane.max_error_px is not None]
    assert max(largest_px) == view.max_error_px
    for plane in view.planes:
        assert plane.max_error_px is not None
        assert plane.holdout_error_px is not None
        assert plane.mean_error_px < plane.rms_px < plane.max_error_px
        assert plane.holdout_error_px == pytest.approx(plane.mean_error_px, rel=0.2)


def test_a_held_out_plane_shows_its_wrong_position_itself() -> None:
    planes = list(seen_planes(paper_camera(), z_mm=(-4.0, -2.0, 0.0, 2.0, 4.0)))
    planes[0] = shifted(planes[0], mm=(0, 0, 0.004))  # not wrong enough to be left out
    wrong, *right = calibrate(calibration_set(only=tuple(planes))).views["only"].planes
    assert wrong.holdout_error_px is not None
    assert wrong.holdout_error_px > 1.2 * wrong.mean_error_px
    assert all(plane.holdout_error_px and plane.holdout_error_px < wrong.holdout_error_px / 1.2 for plane in right)


def test_wrong_corners_are_counted() -> None:
    planes = list(seen_planes(paper_camera()))
    planes[0].image_px[:40] += 25.0
    view = calibrate(calibration_set(only=tuple(planes))).views["only"]
    assert view.n_rejected == 40
    assert view.n_points == 3910 - 40
    assert view.planes[0].n_points == 391 - 40


@pytest.mark.parametrize("tilt_deg", [0.0, 30.0])
def test_coplanar_points_are_refused_however_they_lie(tilt_deg: float) -> None:
    tilt = np.deg2rad(tilt_deg)
    turn = np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])
    points_mm = target_plane_mm(0.0) @ turn.T
    plane = PlaneObservation("flat", points_mm, points_mm[:, :2])
    assert degeneracy([plane]) is not None
    with pytest.raises(CalibrationError, match=r"^view3: the target hardly moved.*one plane.*a camera needs 2 %"):
        check_motion("view3", [plane])
    assert degeneracy(seen_planes(paper_camera(), z_mm=(-1.0, 1.0))) is None


def test_outline_encloses_all_points() -> None:
    square = [(-11.0, -8.0), (-11.0, 8.0), (11.0, -8.0), (11.0, 8.0)]
    assert sorted(outline_mm(seen_planes(paper_camera(), z_mm=(0.0,)))) == square


def test_camera_that_is_perfect_is_good() -> None:
    camera = paper_camera()
    view = calibrate(calibration_set(only=seen_planes(camera, noise_px=0.0))).views["only"]
    assert isinstance(view.mapping, PinholeCamera)
    assert view.max_error_px < 1e-3
    assert view.verdict == "good"
