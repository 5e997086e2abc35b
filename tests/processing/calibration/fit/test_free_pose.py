"""Boards in free poses give the camera, where they are really turned."""

import cv2
import numpy as np
import pytest

from processing.calibration.errors import CalibrationError
from processing.calibration.fit.free_pose import board_errors_px, fit_free_poses, free_pose_holdout_px
from processing.calibration.observation import PlaneObservation
from processing.geometry import PinholeCamera

CAMERA = PinholeCamera(
    np.array([[536.0, 0, 330.0], [0, 534.0, 245.0], [0, 0, 1]]),
    np.eye(3),
    np.zeros(3),
    (640, 480),
    np.array([-0.28, 0.1, 1e-3, -5e-4, 0.0]),
)


def boards(n: int = 10, tilt_rad: float = 0.5, noise_px: float = 0.1, seed: int = 1) -> list[PlaneObservation]:
    """Boards of 9 x 6 corners, 25 mm apart, about half a metre away."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(9) - 4, np.arange(6) - 2.5)
    board_mm = 25.0 * np.column_stack([x.ravel(), y.ravel(), np.zeros(54)])
    seen = []
    for number in range(n):
        rotation = cv2.Rodrigues(rng.uniform(-tilt_rad, tilt_rad, 3) * [1, 1, 0.3])[0]
        place_mm = rng.uniform([-40, -30, 420], [40, 30, 600])
        image_px = CAMERA.project(board_mm @ rotation.T + place_mm) + rng.normal(0, noise_px, (54, 2))
        seen.append(PlaneObservation(f"board{number:02d}", board_mm, image_px, free_pose=True))
    return seen


def test_the_camera_is_recovered() -> None:
    fitted = fit_free_poses(boards(), CAMERA.image_size_px)
    np.testing.assert_allclose(fitted.camera.camera_matrix, CAMERA.camera_matrix, atol=4.0)
    errors_px = [
        board_errors_px(fitted.camera, board, pose).mean() for board, pose in zip(boards(), fitted.poses, strict=True)
    ]
    assert np.mean(errors_px) == pytest.approx(0.1 * np.sqrt(np.pi / 2), rel=0.1)


def test_holdout_error_is_a_little_above_the_noise() -> None:
    distances_px = free_pose_holdout_px(boards(), CAMERA.image_size_px)
    assert [len(distance_px) for distance_px in distances_px] == [27] * 10
    assert 0.11 < np.concatenate(distances_px).mean() < 0.2


def test_three_boards_are_judged_by_their_own_points() -> None:
    assert 0.11 < np.mean(free_pose_holdout_px(boards(3), CAMERA.image_size_px)) < 0.25


def test_a_bad_board_is_named() -> None:
    seen = boards()
    seen[4].image_px[10] += 8.0
    fitted = fit_free_poses(seen, CAMERA.image_size_px)
    means_px = [
        board_errors_px(fitted.camera, board, pose).mean() for board, pose in zip(seen, fitted.poses, strict=True)
    ]
    assert int(np.argmax(means_px)) == 4


def test_parallel_boards_are_refused_though_they_fit_well() -> None:
    with pytest.raises(CalibrationError, match=r"parallel within .* deg, at least 5 deg.*give z_mm"):
        fit_free_poses(boards(tilt_rad=0.01), CAMERA.image_size_px)


def test_two_boards_are_refused() -> None:
    with pytest.raises(CalibrationError, match="2 boards in free poses, at least 3"):
        fit_free_poses(boards(2), CAMERA.image_size_px)
