"""Backlit calibration targets on glass, and their exact views: pixel -> plane z through the full camera model."""

from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from scipy.interpolate import RectBivariateSpline

from processing.geometry import PinholeCamera
from processing.synthetic.rendering import depth_out_of_focus_mm
from processing.synthetic.stamping import FloatImage
from processing.synthetic.view_optics import ViewOptics

_NODE_PITCH_PX = 16
"""Rays are cast at nodes and interpolated by cubic splines: the camera model is smooth, the error below 1e-4 px."""


class Target(Protocol):
    """A flat calibration target across z, its origin in the middle."""

    def transmittance(self, x_mm: FloatImage, y_mm: FloatImage) -> FloatImage:
        """Transmittance of the glass at every pixel, averaged over its area.

        Parameters
        ----------
        x_mm, y_mm : (row, column) arrays
            Where the pixels' lines of sight meet the target.
        """


@dataclass(frozen=True)
class Checkerboard:
    """Chromium squares on clear glass; its points are the inner corners, the middle one at x = y = 0.

    Parameters
    ----------
    columns, rows : int
        Number of inner corners along x and y.
    pitch_mm : float
        Edge of a square.
    """

    columns: int = 23
    rows: int = 17
    pitch_mm: float = 1.0

    def transmittance(self, x_mm: FloatImage, y_mm: FloatImage) -> FloatImage:
        """Transmittance of the glass at every pixel, averaged over its area."""
        white = 0.5 + 0.5 * self._stripes(x_mm, self.columns) * self._stripes(y_mm, self.rows)
        inside_x = _coverage(np.float32(0.5 * (self.columns + 1) * self.pitch_mm) - np.abs(x_mm))
        inside_y = _coverage(np.float32(0.5 * (self.rows + 1) * self.pitch_mm) - np.abs(y_mm))
        return np.asarray(1 - inside_x * inside_y * (1 - white), dtype=np.float32)

    def _stripes(self, position_mm: FloatImage, corners: int) -> FloatImage:
        """-1 and 1 in turn, changing sign at the corners; constant beyond the outermost ones."""
        phase = position_mm / np.float32(self.pitch_mm) + np.float32(0.5 * (corners - 1))
        phase = np.clip(phase, -0.5, corners - 0.5)
        beyond_edge = 0.5 - np.abs(np.mod(phase + np.float32(0.5), 2) - 1)
        return 2 * _coverage(beyond_edge) - 1


@dataclass(frozen=True)
class DotTarget:
    """Chromium dots on clear glass; the points are their centres.

    Seen obliquely, the centroid of a dot lies up to 0.01 px beside its projected centre.

    Parameters
    ----------
    columns, rows : int
        Number of dots along x and y.
    pitch_mm, diameter_mm : float
        Distance and diameter of the dots.
    """

    columns: int = 23
    rows: int = 17
    pitch_mm: float = 1.0
    diameter_mm: float = 0.4

    def transmittance(self, x_mm: FloatImage, y_mm: FloatImage) -> FloatImage:
        """Transmittance of the glass at every pixel, averaged over its area."""
        from_centre_mm = np.hypot(self._from_nearest(x_mm, self.columns), self._from_nearest(y_mm, self.rows))
        return 1 - _coverage(np.float32(0.5 * self.diameter_mm) - from_centre_mm)

    def _from_nearest(self, position_mm: FloatImage, count: int) -> FloatImage:
        """Distance from the nearest line of the lattice, along one axis."""
        half = 0.5 * (count - 1)
        phase = position_mm / np.float32(self.pitch_mm) + np.float32(half)
        nearest = np.clip(np.rint(phase), 0, count - 1)
        return np.asarray((phase - nearest) * np.float32(self.pitch_mm), dtype=np.float32)


def render_target(camera: PinholeCamera, target: Target, z_mm: float, optics: ViewOptics) -> FloatImage:
    """Transmittance of a target on the plane z as one view sees it.

    The pattern faces the view, so that the light does not cross the glass; edges are averaged over the pixel and
    blurred by diffraction and defocus (at the middle of the image).

    Parameters
    ----------
    camera : PinholeCamera
        Projection, distortion and tilt included.
    target : Target
        Checkerboard or dots, its origin at x = y = 0.
    z_mm : float
        Position of the target.
    optics : ViewOptics
        Diffraction and defocus.

    Returns
    -------
    (row, column) float32 array
        1 where light passes, 0 behind chromium.
    """
    x_mm, y_mm = plane_coordinates(camera, z_mm)
    depth_mm = depth_out_of_focus_mm(camera, np.array([[0.0, 0.0, z_mm]]))
    sigma_px = float(optics.optical_sigma_px(depth_mm)[0])
    blurred = cv2.GaussianBlur(target.transmittance(x_mm, y_mm), (0, 0), sigma_px, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(blurred, dtype=np.float32)


def plane_coordinates(camera: PinholeCamera, z_mm: float) -> tuple[FloatImage, FloatImage]:
    """Where the line of sight of every pixel meets the plane z: x and y, each (row, column) in mm."""
    width_px, height_px = camera.image_size_px
    node_u = np.linspace(0, width_px - 1, max(5, width_px // _NODE_PITCH_PX))
    node_v = np.linspace(0, height_px - 1, max(5, height_px // _NODE_PITCH_PX))
    v, u = np.meshgrid(node_v, node_u, indexing="ij")
    nodes_mm = camera.back_project(np.column_stack([u.ravel(), v.ravel()]), z_mm)
    x_mm, y_mm = (
        RectBivariateSpline(node_v, node_u, nodes_mm[:, axis].reshape(u.shape))(
            np.arange(height_px), np.arange(width_px)
        ).astype(np.float32)
        for axis in (0, 1)
    )
    return x_mm, y_mm


def _coverage(inside: FloatImage) -> FloatImage:
    """Covered part of every pixel, from the signed distance to the edge in any unit (positive: covered)."""
    down, right = np.gradient(inside)
    distance_px = inside / np.maximum(np.hypot(down, right), np.float32(1e-9))
    return np.asarray(np.clip(distance_px + np.float32(0.5), 0, 1), dtype=np.float32)
