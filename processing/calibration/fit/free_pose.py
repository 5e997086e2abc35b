"""Zhang's calibration: boards in free poses give the intrinsics of a camera, not its place in the world."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from processing.calibration.calibration import BoardPose
from processing.calibration.errors import CalibrationError
from processing.calibration.observation import PlaneObservation
from processing.geometry import FloatArray, PinholeCamera

MIN_BOARDS = 3
"""Fewer boards do not determine all intrinsics (Zhang 2000)."""
MIN_TILT_DEG = 5.0
"""Largest angle between two boards; nearly parallel boards fit well and give a wrong camera."""
FOLDS = 5


@dataclass(frozen=True)
class FreePoseFit:
    """Intrinsics, and the pose of every board.

    Parameters
    ----------
    camera : PinholeCamera
        In its own coordinates: no rotation, no translation.
    poses : tuple[BoardPose, ...]
        In the order of the boards.
    """

    camera: PinholeCamera
    poses: tuple[BoardPose, ...]


def fit_free_poses(boards: Sequence[PlaneObservation], image_size_px: tuple[int, int]) -> FreePoseFit:
    """Fit one camera to several boards.

    Raises
    ------
    CalibrationError
        There are too few boards, or they are all parallel.
    """
    if len(boards) < MIN_BOARDS:
        raise CalibrationError(f"{len(boards)} boards in free poses, at least {MIN_BOARDS} are needed")
    matrix, coefficients, rotations, shifts_mm = _solved(boards, image_size_px)
    poses = tuple(
        BoardPose(board.name, np.asarray(cv2.Rodrigues(rotation)[0], np.float64), shift_mm)
        for board, rotation, shift_mm in zip(boards, rotations, shifts_mm, strict=True)
    )
    _check_tilts(poses)
    return FreePoseFit(PinholeCamera(matrix, np.eye(3), np.zeros(3), image_size_px, coefficients[:5]), poses)


def _solved(
    boards: Sequence[PlaneObservation], image_size_px: tuple[int, int]
) -> tuple[FloatArray, FloatArray, list[FloatArray], list[FloatArray]]:
    """Camera matrix and coefficients; rotation vector and shift in mm of every board."""
    try:
        _, matrix, coefficients, rotations, shifts_mm = cv2.calibrateCamera(
            [board.points_mm.astype(np.float32) for board in boards],
            [board.image_px.astype(np.float32) for board in boards],
            image_size_px,
            np.eye(3),
            np.zeros(5),
            criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-10),
        )
    except cv2.error as error:
        raise CalibrationError(f"{len(boards)} boards do not determine a camera: {error.err}") from error
    if not np.all(np.isfinite(matrix)):
        raise CalibrationError(f"{len(boards)} boards do not determine a camera: they are all parallel")
    return (
        np.asarray(matrix, dtype=np.float64),
        np.asarray(coefficients, dtype=np.float64).ravel(),
        [np.asarray(one, dtype=np.float64) for one in rotations],
        [np.asarray(one, dtype=np.float64).ravel() for one in shifts_mm],
    )


def _check_tilts(poses: Sequence[BoardPose]) -> None:
    normals = np.array([pose.rotation[:, 2] for pose in poses])
    tilt_deg = float(np.degrees(np.arccos(np.clip(normals @ normals.T, -1, 1)).max()))
    if tilt_deg < MIN_TILT_DEG:
        raise CalibrationError(
            f"{len(poses)} boards in free poses are parallel within {tilt_deg:.2g} deg, "
            f"at least {MIN_TILT_DEG:g} deg are needed; if a stage moved the target, give z_mm"
        )


def board_errors_px(camera: PinholeCamera, board: PlaneObservation, pose: BoardPose) -> FloatArray:
    """Back-projection errors (N,) of a board in its pose (eq. 2)."""
    in_camera_mm = board.points_mm @ pose.rotation.T + pose.translation_mm
    return np.asarray(np.linalg.norm(camera.project(in_camera_mm) - board.image_px, axis=1), dtype=np.float64)


def free_pose_holdout_px(boards: Sequence[PlaneObservation], image_size_px: tuple[int, int]) -> list[FloatArray]:
    """Errors on every board when the intrinsics have not seen its image.

    The pose of a held-out board comes from every other of its points, its error from the rest.
    """
    if len(boards) <= MIN_BOARDS:
        camera = fit_free_poses(boards, image_size_px).camera
        return [_unseen_error_px(camera, board) for board in boards]
    folds = range(min(FOLDS, len(boards)))
    cameras = [
        fit_free_poses([board for number, board in enumerate(boards) if number % FOLDS != fold], image_size_px).camera
        for fold in folds
    ]
    return [_unseen_error_px(cameras[number % FOLDS], board) for number, board in enumerate(boards)]


def _unseen_error_px(camera: PinholeCamera, board: PlaneObservation) -> FloatArray:
    posing = np.arange(len(board)) % 2 == 0
    _, rotation, translation_mm = cv2.solvePnP(
        np.ascontiguousarray(board.points_mm[posing]),
        np.ascontiguousarray(board.image_px[posing]),
        camera.camera_matrix,
        camera.coefficients,
    )
    pose = BoardPose(
        board.name, np.asarray(cv2.Rodrigues(rotation)[0], np.float64), np.asarray(translation_mm, np.float64).ravel()
    )
    return board_errors_px(camera, board.select(~posing), pose)
