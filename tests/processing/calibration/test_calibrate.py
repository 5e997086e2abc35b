"""One joint fit per view finds the camera where planes fitted one by one cannot."""

from dataclasses import replace

import numpy as np
import pytest

from processing.calibration.calibrate import calibrate
from processing.calibration.errors import CalibrationError
from processing.calibration.fit.pinhole_fit import fit_pinhole
from processing.calibration.observation import PlaneObservation, stacked
from tests.support.calibration_cases import (
    calibration_set,
    paper_camera,
    seen_planes,
    target_plane_mm,
    true_errors_px,
    volume_points_mm,
)


@pytest.mark.parametrize("azimuth_deg", [-45.0, -15.0, 0.0, 45.0])
def test_true_error_in_the_volume_is_a_few_thousandths_of_a_pixel(azimuth_deg: float) -> None:
    camera = paper_camera(azimuth_deg)
    fitted = fit_pinhole(*stacked(seen_planes(camera)), camera.image_size_px)
    assert true_errors_px(fitted.camera, camera).mean() < 0.004
    assert fitted.used.mean() > 0.999


def test_exact_points_give_the_exact_camera() -> None:
    camera = paper_camera(30.0, distortion=(0.0, 0.0, 0.0, 0.0, 0.0))
    fitted = fit_pinhole(*stacked(seen_planes(camera, noise_px=0)), camera.image_size_px)
    assert true_errors_px(fitted.camera, camera).max() < 1e-4
    assert fitted.camera.camera_matrix[0, 0] == pytest.approx(camera.camera_matrix[0, 0], rel=1e-3)


def test_tilted_sensor_is_described_by_the_tilted_model() -> None:
    camera = replace(paper_camera(45.0, distortion=(0.0,) * 5), tilt_rad=(0.02, 0.12))
    points = stacked(seen_planes(camera))
    tilted = fit_pinhole(*points, camera.image_size_px, tilted=True)
    assert true_errors_px(tilted.camera, camera).mean() < 0.006
    assert tilted.camera.tilt_rad != (0.0, 0.0)


def test_wrong_corners_are_found_and_do_no_harm() -> None:
    camera = paper_camera()
    points_mm, image_px = stacked(seen_planes(camera))
    wrong = np.random.default_rng(5).random(len(points_mm)) < 0.1
    image_px[wrong] += 60.0
    fitted = fit_pinhole(points_mm, image_px, camera.image_size_px)
    np.testing.assert_array_equal(fitted.used, ~wrong)
    assert true_errors_px(fitted.camera, camera).mean() < 0.005


def test_camera_on_the_other_side_of_the_target_is_found() -> None:
    camera = paper_camera(160.0)
    fitted = fit_pinhole(*stacked(seen_planes(camera)), camera.image_size_px)
    assert true_errors_px(fitted.camera, camera).mean() < 0.004


def test_left_handed_axes_are_refused() -> None:
    planes = seen_planes(paper_camera(15.0))
    mirrored = tuple(PlaneObservation(plane.name, plane.points_mm * (1, 1, -1), plane.image_px) for plane in planes)
    assert calibrate(calibration_set(only=planes)).notes == ()
    with pytest.raises(CalibrationError, match=r"^only: the target's axes are left-handed"):
        calibrate(calibration_set(only=mirrored))


@pytest.mark.parametrize(("model", "pitch"), [("pinhole", 0.5), ("pinhole", 1.25), ("pinhole_tilted", 2.0)])
def test_a_wrong_pitch_fits_nearly_as_well_and_shows_in_the_pixels(model: str, pitch: float) -> None:
    planes = seen_planes(paper_camera(45.0), z_mm=(-4, -1, 1, 4), columns=15, rows=11)
    wrong = tuple(replace(plane, points_mm=plane.points_mm * (pitch, pitch, 1)) for plane in planes)
    calibration = calibrate(calibration_set(right=planes, wrong=wrong), model)
    assert calibration.views["right"].verdict == "usable"
    assert calibration.views["wrong"].verdict == "warn"
    (note,) = calibration.notes
    assert note.startswith("wrong: its pixels seem ")
    assert note.endswith("is pitch_mm of the target right, and the position of its planes in mm?")


def test_too_few_points_are_refused() -> None:
    with pytest.raises(CalibrationError, match="8 points for 15 parameters, need 9"):
        fit_pinhole(volume_points_mm(8), np.zeros((8, 2)), (100, 100))


def test_views_are_calibrated_and_judged() -> None:
    cameras = {"left": paper_camera(-45.0), "right": paper_camera(15.0)}
    seen = {name: seen_planes(camera, noise_px=0.02) for name, camera in cameras.items()}
    calibration = calibrate(calibration_set(**seen))
    for name, camera in cameras.items():
        view = calibration.views[name]
        assert true_errors_px(view.mapping, camera).mean() < 0.002
        assert view.verdict == "good"
        assert view.mean_error_px == pytest.approx(0.02 * np.sqrt(np.pi / 2), rel=0.05)
        assert view.rms_px == pytest.approx(0.02 * np.sqrt(2), rel=0.05)
        assert view.mean_error_px < view.holdout_error_px < 1.05 * view.mean_error_px
        assert [plane.z_mm for plane in view.planes] == pytest.approx(np.linspace(-4.5, 4.5, 10))
    assert calibration.z_range_mm == (-4.5, 4.5)
    assert calibration.x_range_mm == (-11.0, 11.0)
    assert calibration.y_range_mm == (-8.0, 8.0)


@pytest.mark.parametrize("model", ["pinhole", "pinhole_tilted", "polynomial"])
def test_every_model_predicts_planes_it_has_not_seen(model: str) -> None:
    camera = paper_camera(15.0)
    view = calibrate(calibration_set(only=seen_planes(camera)), model=model).views["only"]
    assert view.model == model
    assert true_errors_px(view.mapping, camera).mean() < 0.01
    assert view.holdout_error_px < 0.07


def test_views_see_different_parts_of_the_range() -> None:
    camera = paper_camera(0.0)
    calibration = calibrate(
        calibration_set(near=seen_planes(camera, z_mm=(-4, -3, -1, 1)), far=seen_planes(camera, z_mm=(-2, 0, 2, 4)))
    )
    assert calibration.z_range_mm == (-2.0, 1.0)


@pytest.mark.parametrize(
    ("z_mm", "reason"), [((1.0,), "z range 0 mm"), ((0.0, 0.01, 0.02), "z range 0.02 mm"), ((-0.1, 0.1), "needs 2 %")]
)
def test_target_that_hardly_moved_is_refused(z_mm: tuple[float, ...], reason: str) -> None:
    still = calibration_set(fine=seen_planes(paper_camera()), still=seen_planes(paper_camera(), z_mm=z_mm))
    with pytest.raises(CalibrationError, match=f"^still: the target hardly moved.*{reason}"):
        calibrate(still)


def test_all_bad_views_are_named_at_once() -> None:
    few = PlaneObservation("few", volume_points_mm(7), np.zeros((7, 2)))
    bad = calibration_set(
        few=(few,),
        fine=seen_planes(paper_camera(), z_mm=(-3.0, 0.0, 3.0)),
        still=seen_planes(paper_camera(), z_mm=(1.0,)),
    )
    with pytest.raises(CalibrationError, match=r"^few: 7 points are too few.*; still: the target hardly moved"):
        calibrate(bad)


def test_handful_of_points_is_refused() -> None:
    few = PlaneObservation("few", volume_points_mm(7), np.zeros((7, 2)))
    with pytest.raises(CalibrationError, match=r"^view2: 7 points are too few, at least 12"):
        calibrate(calibration_set(view2=(few,)))


def test_boards_in_free_poses_cannot_be_reconstructed_with() -> None:
    camera = paper_camera(0.0, principal_offset_px=(0, 0))
    rng = np.random.default_rng(3)
    boards = []
    for number in range(8):
        turn = np.linalg.qr(np.eye(3) + 0.35 * rng.normal(size=(3, 3)))[0]
        turn *= np.sign(np.diag(turn))
        board_mm = target_plane_mm(0.0)
        image_px = camera.project(board_mm @ turn.T) + rng.normal(0, 0.02, (len(board_mm), 2))
        boards.append(PlaneObservation(f"board {number}", board_mm, image_px, free_pose=True))
    calibration = calibrate(calibration_set(only=tuple(boards)))
    assert [pose.name for pose in calibration.views["only"].boards_in_free_poses] == [board.name for board in boards]
    with pytest.raises(CalibrationError, match="only: boards stood in free poses, so only the intrinsics are known"):
        calibration.require_world()
    with pytest.raises(CalibrationError, match="free poses give a pinhole camera, not polynomial"):
        calibrate(calibration_set(only=tuple(boards)), model="polynomial")
