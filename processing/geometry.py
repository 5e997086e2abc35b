"""Conventions and the pinhole camera (eqs. 3 to 5 of the paper, lens distortion, Scheimpflug tilt).

World coordinates are right-handed, in mm: y points down, as image rows do; a view at azimuth 0 looks
along +z. Points are (N, 3) arrays (x, y, z); image points are (N, 2) arrays (u, v) = (column, row) in px,
pixel centres at integers. Angles are radians here, degrees in configuration files.
"""

import math
from dataclasses import dataclass, field
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class ViewMapping(Protocol):
    """Where a view sees points of the world; every camera model is one."""

    @property
    def image_size_px(self) -> tuple[int, int]:
        """(width, height) of the image."""

    def project(self, points_mm: FloatArray) -> FloatArray:
        """Image points (N, 2) in px of world points (N, 3) in mm."""


def rotation_from_angles(yaw_rad: float, pitch_rad: float = 0.0, roll_rad: float = 0.0) -> FloatArray:
    """Rotation matrix of a view (eq. 4): yaw around y, then pitch around the new x, then roll around the view axis."""
    cy, sy = np.cos(yaw_rad), np.sin(yaw_rad)
    cp, sp = np.cos(pitch_rad), np.sin(pitch_rad)
    cr, sr = np.cos(roll_rad), np.sin(roll_rad)
    yaw = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]])
    pitch = np.array([[1, 0, 0], [0, cp, sp], [0, -sp, cp]])
    roll = np.array([[cr, sr, 0], [-sr, cr, 0], [0, 0, 1]])
    return np.asarray(roll @ pitch @ yaw, dtype=np.float64)


def rotation_vector_of(rotation: FloatArray) -> FloatArray:
    """Axis times angle (3,) of a rotation (3, 3), however small; OpenCV's own takes angles below 1e-5 for none.

    By way of the quaternion whose largest element is computed first (Shepperd 1978): exact at any angle.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation.tolist()
    trace, twist = xx + yy + zz, (zy - yz, xz - zx, yx - xy)
    if trace >= max(xx, yy, zz):
        scalar, vector = 1 + trace, twist
    elif xx >= max(yy, zz):
        scalar, vector = twist[0], (1 + xx - yy - zz, xy + yx, xz + zx)
    elif yy >= zz:
        scalar, vector = twist[1], (xy + yx, 1 + yy - xx - zz, yz + zy)
    else:
        scalar, vector = twist[2], (xz + zx, yz + zy, 1 + zz - xx - yy)
    size = math.hypot(*vector)
    angle_rad = 2 * math.atan2(size, abs(scalar))
    return np.array(vector) * (math.copysign(angle_rad, scalar) / size if size else 0.0)


def tilt_matrix(tilt_rad: FloatArray) -> FloatArray:
    """Homographies (..., 3, 3) of the lens's image onto sensors tilted by (..., 2) around x and y, as in OpenCV."""
    (cos_x, cos_y), (sin_x, sin_y) = np.moveaxis(np.cos(tilt_rad), -1, 0), np.moveaxis(np.sin(tilt_rad), -1, 0)
    homography = np.zeros((*cos_x.shape, 3, 3))
    homography[..., 0, 0] = cos_x
    homography[..., 1, 0] = -sin_x * sin_y
    homography[..., 1, 1] = cos_y
    homography[..., 2, 0] = sin_y
    homography[..., 2, 1] = -cos_y * sin_x
    homography[..., 2, 2] = cos_y * cos_x
    return homography


@dataclass(frozen=True, eq=False)
class PinholeCamera:
    """A pinhole camera with lens distortion and Scheimpflug tilt (eq. 3; OpenCV's tilted model).

    Parameters
    ----------
    camera_matrix : (3, 3) array
        A of eq. 3, in px.
    rotation : (3, 3) array
        R of eq. 3, world to camera.
    translation_mm : (3,) array
        t of eq. 3.
    image_size_px : tuple[int, int]
        (width, height).
    distortion : (5,) array
        Brown-Conrady k1, k2, p1, p2, k3.
    tilt_rad : tuple[float, float]
        Tilt of the sensor around its x and y axis.
    """

    camera_matrix: FloatArray
    rotation: FloatArray
    translation_mm: FloatArray
    image_size_px: tuple[int, int]
    distortion: FloatArray = field(default_factory=lambda: np.zeros(5))
    tilt_rad: tuple[float, float] = (0.0, 0.0)

    @property
    def centre_mm(self) -> FloatArray:
        """Centre of projection in world coordinates, (3,)."""
        return np.asarray(-self.rotation.T @ self.translation_mm, dtype=np.float64)

    @property
    def coefficients(self) -> FloatArray:
        """The 14 distortion coefficients in OpenCV's order."""
        return np.concatenate([self.distortion, np.zeros(7), self.tilt_rad]).astype(np.float64)

    def project(self, points_mm: FloatArray) -> FloatArray:
        """Image points (N, 2) in px of world points (N, 3) in mm, distortion included."""
        x_mm, y_mm, depth_mm = self.rotation @ np.asarray(points_mm, np.float64).reshape(-1, 3).T + np.reshape(
            self.translation_mm, (3, 1)
        )
        x, y = self._on_sensor(x_mm / depth_mm, y_mm / depth_mm)
        (focal_u, _, centre_u), (_, focal_v, centre_v) = self.camera_matrix[:2]
        return np.column_stack([focal_u * x + centre_u, focal_v * y + centre_v])

    def _on_sensor(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Ideal image points at focal length 1, after distortion (Brown 1971) and tilt: OpenCV's model."""
        k1, k2, p1, p2, k3 = self.distortion.tolist()
        if k1 or k2 or p1 or p2 or k3:
            r2, xy = x * x + y * y, x * y
            radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
            x, y = x * radial + 2 * p1 * xy + p2 * (r2 + 2 * x * x), y * radial + 2 * p2 * xy + p1 * (r2 + 2 * y * y)
        if not any(self.tilt_rad):
            return x, y
        tilted = tilt_matrix(np.array(self.tilt_rad)) @ np.stack([x, y, np.ones_like(x)])
        return tilted[0] / tilted[2], tilted[1] / tilted[2]

    def undistort(self, image_px: FloatArray) -> FloatArray:
        """Image points (N, 2) that the same camera without distortion and tilt would see."""
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-12)
        ideal_px = cv2.undistortPointsIter(
            np.ascontiguousarray(image_px, dtype=np.float64).reshape(-1, 1, 2),
            self.camera_matrix,
            self.coefficients,
            np.eye(3),
            self.camera_matrix,
            criteria,
        )
        return np.asarray(ideal_px, dtype=np.float64).reshape(-1, 2)

    def plane_homography(self, z_mm: float) -> FloatArray:
        """H_z of eq. 5: (x, y, 1) on the plane z to undistorted image points (u, v, 1), (3, 3)."""
        projection = self.camera_matrix @ np.column_stack([self.rotation, self.translation_mm])
        return np.column_stack([projection[:, 0], projection[:, 1], projection[:, 2] * z_mm + projection[:, 3]])

    def back_project(self, image_px: FloatArray, z_mm: float) -> FloatArray:
        """World points (N, 3) on the plane z that are seen at image points (N, 2) (eq. 5)."""
        ideal_px = self.undistort(image_px)
        homogeneous = np.column_stack([ideal_px, np.ones(len(ideal_px))]) @ np.linalg.inv(self.plane_homography(z_mm)).T
        plane_mm = homogeneous[:, :2] / homogeneous[:, 2:]
        return np.column_stack([plane_mm, np.full(len(plane_mm), z_mm)])

    def ray_directions(self, points_mm: FloatArray) -> FloatArray:
        """Unit vectors (N, 3) from the centre of projection to world points."""
        directions = np.asarray(points_mm) - self.centre_mm
        return np.asarray(directions / np.linalg.norm(directions, axis=-1, keepdims=True), dtype=np.float64)


def view_camera(
    azimuth_deg: float,
    *,
    focal_length_mm: float,
    magnification: float,
    scale_px_per_mm: float,
    image_size_px: tuple[int, int] = (1600, 1200),
    pitch_deg: float = 0.0,
    roll_deg: float = 0.0,
    distortion: FloatArray | None = None,
    principal_offset_px: tuple[float, float] = (0.0, 0.0),
) -> PinholeCamera:
    """Camera of a view that looks at the world origin from its working distance f (1 + 1 / M).

    Parameters
    ----------
    azimuth_deg, pitch_deg, roll_deg : float
        Viewing angles phi and psi of the paper, and the roll around the view axis.
    focal_length_mm, magnification : float
        Lens of the view (Table 1).
    scale_px_per_mm : float
        Image scale at the world origin.
    image_size_px : tuple[int, int]
        (width, height).
    distortion : (5,) array, optional
        Brown-Conrady coefficients.
    principal_offset_px : tuple[float, float]
        Distance of the optical axis from the image centre, as a Scheimpflug adaptor gives.
    """
    width_px, height_px = image_size_px
    distance_mm = focal_length_mm * (1 + 1 / magnification)
    focal_px = scale_px_per_mm * distance_mm
    centre_u_px, centre_v_px = (width_px - 1) / 2 + principal_offset_px[0], (height_px - 1) / 2 + principal_offset_px[1]
    shift_mm = np.array(principal_offset_px) / scale_px_per_mm
    return PinholeCamera(
        camera_matrix=np.array([[focal_px, 0, centre_u_px], [0, focal_px, centre_v_px], [0, 0, 1.0]]),
        rotation=rotation_from_angles(*np.deg2rad([azimuth_deg, pitch_deg, roll_deg])),
        translation_mm=np.array([-shift_mm[0], -shift_mm[1], distance_mm]),
        image_size_px=image_size_px,
        distortion=np.zeros(5) if distortion is None else np.asarray(distortion, dtype=np.float64),
    )
