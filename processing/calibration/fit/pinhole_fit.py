"""A pinhole camera fitted to points at known places (eq. 3): one pose, all intrinsics free, all points at once.

Planes fitted one by one cannot tell the principal point from a tilt of the plane; the known travel of the
stage can. The fit starts from a direct linear transformation and refines all parameters together, told as what
the image shows (``processing.calibration.fit.aim``). What looks like a principal point far off may as well be a tilted
sensor: with tilt, the fit starts from a principal point in the middle of the image.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import rq

from processing.calibration.errors import CalibrationError
from processing.calibration.fit.aim import Aim
from processing.calibration.fit.least_squares import REJECT_FLOOR_PX, REJECT_SCALE, ROBUST_SCALE, minimise
from processing.geometry import FloatArray, PinholeCamera, rotation_vector_of

PINHOLE_PARAMETERS = 15
TILT_PARAMETERS = 2
_TILT_COLUMNS = (22, 23)
"""Where OpenCV's Jacobian has the tilt: 3 rotation, 3 translation, 2 + 2 matrix, then 14 coefficients."""

PARAMETER_NAMES = (
    *("rotation_x_rad", "rotation_y_rad", "rotation_z_rad", "translation_x_mm", "translation_y_mm", "translation_z_mm"),
    *("focal_u_px", "focal_v_px", "centre_u_px", "centre_v_px", "k1", "k2", "p1", "p2", "k3"),
    *("tilt_x_rad", "tilt_y_rad"),
)
"""What is fitted, in order; the rotation as a Rodrigues vector."""


@dataclass(frozen=True, eq=False)
class FittedCamera:
    """A camera, and which points it was fitted to.

    Parameters
    ----------
    camera : PinholeCamera
        The result.
    used : (N,) array
        False for points that were left out as wrong.
    """

    camera: PinholeCamera
    used: NDArray[np.bool_]


def fit_pinhole(
    points_mm: FloatArray, image_px: FloatArray, image_size_px: tuple[int, int], *, tilted: bool = False
) -> FittedCamera:
    """Fit pose, focal lengths, principal point, k1, k2, p1, p2, k3 and, if wanted, the sensor's tilt.

    Parameters
    ----------
    points_mm : (N, 3) array
        World points; not all in one plane.
    image_px : (N, 2) array
        Where they are seen; wrong ones among them are found and left out.
    image_size_px : tuple[int, int]
        (width, height).
    tilted : bool
        Fit the tilt of a Scheimpflug adaptor too.

    Raises
    ------
    CalibrationError
        There are too few points.
    """
    n_parameters = PINHOLE_PARAMETERS + TILT_PARAMETERS * tilted
    points_mm = np.ascontiguousarray(points_mm, dtype=np.float64)
    if 2 * len(points_mm) < n_parameters + 3:
        raise CalibrationError(f"{len(points_mm)} points for {n_parameters} parameters, need {(n_parameters + 4) // 2}")
    start = _pack(_first_guess(points_mm, image_px, image_size_px), tilted)
    if tilted:
        start = Aim.at(start, points_mm.mean(axis=0)).with_centre(start, (np.array(image_size_px) - 1) / 2)
    scale_px = max(_spread_px(_residuals_px(start, points_mm, image_px)), 0.05)
    robust = _refine(start, points_mm, image_px, ROBUST_SCALE * scale_px)
    scale_px = max(_spread_px(_residuals_px(robust, points_mm, image_px)), 1e-4)
    robust = _refine(robust, points_mm, image_px, ROBUST_SCALE * scale_px)
    residual_px = np.linalg.norm(_residuals_px(robust, points_mm, image_px), axis=1)
    used = np.asarray(residual_px < max(REJECT_SCALE * scale_px, REJECT_FLOOR_PX), dtype=np.bool_)
    if 2 * used.sum() < n_parameters + 3:
        raise CalibrationError(f"only {used.sum()} of {len(used)} points agree with a pinhole camera")
    parameters = _refine(robust, points_mm[used], image_px[used], None)
    return FittedCamera(_unpack(parameters, image_size_px), used)


def camera_derivatives(camera: PinholeCamera, points_mm: FloatArray, *, tilted: bool) -> FloatArray:
    """Derivatives (2 N, parameters) of image points by the parameters of ``PARAMETER_NAMES``, u before v."""
    return _project(_pack(camera, tilted), np.ascontiguousarray(points_mm, dtype=np.float64))[1]


def direct_linear_transformation(points_mm: FloatArray, image_px: FloatArray, weights: FloatArray) -> FloatArray:
    """Projection matrix (3, 4) from weighted points (N, 3) and image points (N, 2), both normalised first."""
    centre_mm, centre_px = points_mm.mean(axis=0), image_px.mean(axis=0)
    scale_mm, scale_px = points_mm.std(axis=0).max(), image_px.std(axis=0).max()
    world = np.column_stack([(points_mm - centre_mm) / scale_mm, np.ones(len(points_mm))])
    image = (image_px - centre_px) / scale_px
    zeros = np.zeros_like(world)
    rows = [np.hstack([world, zeros, -image[:, :1] * world]), np.hstack([zeros, world, -image[:, 1:] * world])]
    equations = np.concatenate([row * weights[:, None] for row in rows])
    projection = np.linalg.eigh(equations.T @ equations)[1][:, 0].reshape(3, 4)
    to_world = np.diag([1 / scale_mm] * 3 + [1.0])
    to_world[:3, 3] = -centre_mm / scale_mm
    to_image = np.array([[scale_px, 0, centre_px[0]], [0, scale_px, centre_px[1]], [0, 0, 1.0]])
    return np.asarray(to_image @ projection @ to_world, dtype=np.float64)


def projected_px(projection: FloatArray, points_mm: FloatArray) -> FloatArray:
    """Image points (N, 2) of world points (N, 3) through a projection matrix (3, 4)."""
    homogeneous = np.column_stack([points_mm, np.ones(len(points_mm))]) @ projection.T
    return np.asarray(homogeneous[:, :2] / homogeneous[:, 2:], dtype=np.float64)


def _first_guess(points_mm: FloatArray, image_px: FloatArray, image_size_px: tuple[int, int]) -> PinholeCamera:
    """Camera of a direct linear transformation in which wrong points have lost their weight."""
    weights = np.ones(len(points_mm))
    for _ in range(6):
        projection = direct_linear_transformation(points_mm, image_px, weights)
        residual_px = np.linalg.norm(projected_px(projection, points_mm) - image_px, axis=1)
        weights = 1 / (1 + (residual_px / max(ROBUST_SCALE * float(np.median(residual_px)), 1e-3)) ** 2)
    return _decompose(projection, image_size_px)


def _decompose(projection: FloatArray, image_size_px: tuple[int, int]) -> PinholeCamera:
    matrix, rotation = rq(projection[:, :3])
    signs = np.diag(np.sign(np.diag(matrix)))
    matrix, rotation = matrix @ signs, signs @ rotation
    translation_mm = np.linalg.solve(matrix, projection[:, 3])
    if np.linalg.det(rotation) < 0:
        rotation, translation_mm = -rotation, -translation_mm
    matrix = matrix / matrix[2, 2]
    matrix[0, 1] = 0.0
    return PinholeCamera(
        np.asarray(matrix, np.float64), np.asarray(rotation, np.float64), translation_mm, image_size_px
    )


def _pack(camera: PinholeCamera, tilted: bool) -> FloatArray:
    matrix = camera.camera_matrix
    rotation_vector = rotation_vector_of(camera.rotation)
    lens = [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *camera.distortion]
    return np.concatenate([rotation_vector, camera.translation_mm, lens, camera.tilt_rad if tilted else ()])


def _unpack(parameters: FloatArray, image_size_px: tuple[int, int]) -> PinholeCamera:
    focal_u, focal_v, centre_u, centre_v = parameters[6:10]
    tilt_rad = parameters[15:17] if len(parameters) > PINHOLE_PARAMETERS else (0.0, 0.0)
    return PinholeCamera(
        camera_matrix=np.array([[focal_u, 0, centre_u], [0, focal_v, centre_v], [0, 0, 1.0]]),
        rotation=np.asarray(cv2.Rodrigues(parameters[:3])[0], dtype=np.float64),
        translation_mm=parameters[3:6].copy(),
        image_size_px=image_size_px,
        distortion=parameters[10:15].copy(),
        tilt_rad=(float(tilt_rad[0]), float(tilt_rad[1])),
    )


def _project(parameters: FloatArray, points_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Image points (N, 2) and their derivatives (2 N, parameters)."""
    camera = _unpack(parameters, (0, 0))
    image_px, jacobian = cv2.projectPoints(
        points_mm, parameters[:3], camera.translation_mm, camera.camera_matrix, camera.coefficients
    )
    columns = [*range(PINHOLE_PARAMETERS), *_TILT_COLUMNS][: len(parameters)]
    return np.asarray(image_px, dtype=np.float64).reshape(-1, 2), np.asarray(jacobian[:, columns], dtype=np.float64)


def _residuals_px(parameters: FloatArray, points_mm: FloatArray, image_px: FloatArray) -> FloatArray:
    return _unpack(parameters, (0, 0)).project(points_mm) - image_px


def _spread_px(residuals_px: FloatArray) -> float:
    """Standard deviation per coordinate, from the median (wrong points do not count)."""
    return 1.4826 * float(np.median(np.abs(residuals_px)))


def _refine(start: FloatArray, points_mm: FloatArray, image_px: FloatArray, robust_px: float | None) -> FloatArray:
    aim = Aim.at(start, points_mm.mean(axis=0))

    def residuals_px(values: FloatArray) -> FloatArray:
        return _residuals_px(aim.parameters(values), points_mm, image_px)

    def derivatives(values: FloatArray) -> FloatArray:
        parameters, by_values = aim.linearised(values)
        return _project(parameters, points_mm)[1] @ by_values

    return aim.parameters(minimise(residuals_px, derivatives, aim.values(start), robust_px))
