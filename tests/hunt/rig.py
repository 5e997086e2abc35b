"""The views of the paper, and where they see points: a pinhole written down once more, without the product's."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from processing.calibration.calibration import Calibration
from processing.geometry import PinholeCamera
from processing.studies.seen_droplets import droplet_calibration

Array = NDArray[np.float64]
SCALE_PX_PER_MM, PIXEL_UM = 60.0, 7.4
SIZE_PX = (320, 220)
AZIMUTHS_DEG = {4: (45.0, 15.0, -15.0, -45.0), 3: (45.0, 0.0, -45.0), 2: (45.0, -45.0)}
FOCAL_LENGTHS_MM = {45.0: 100.0, 15.0: 85.0, 0.0: 85.0, -15.0: 85.0, -45.0: 100.0}
MAGNIFICATIONS = {45.0: 0.45, 15.0: 0.43, 0.0: 0.43, -15.0: 0.44, -45.0: 0.43}
AIRY_UM = {45.0: 39.0, 15.0: 28.0, 0.0: 28.0, -15.0: 28.0, -45.0: 38.0}
"""Table 1 of the paper; the view at 0 degrees has the lens of its neighbours."""


@dataclass(frozen=True)
class Eye:
    """A view that looks at the origin; how far it was moved since it was calibrated.

    Parameters
    ----------
    azimuth_deg : float
        0 looks along +z.
    shift_px : tuple[float, float]
        Of the image, along columns and rows.
    zoom : float
        Of the image around its middle.
    roll_deg : float
        Of the image around its middle.
    """

    azimuth_deg: float
    shift_px: tuple[float, float] = (0.0, 0.0)
    zoom: float = 1.0
    roll_deg: float = 0.0

    @property
    def distance_mm(self) -> float:
        return FOCAL_LENGTHS_MM[self.azimuth_deg] * (1 + 1 / MAGNIFICATIONS[self.azimuth_deg])

    @property
    def airy_px(self) -> float:
        """Diameter of the Airy disk, in pixels."""
        return AIRY_UM[self.azimuth_deg] / PIXEL_UM

    def sees(self, points_mm: Array) -> tuple[Array, Array]:
        """Image points (N, 2) in px, columns first, and pixels per mm (N,) there."""
        angle, roll = np.radians([self.azimuth_deg, self.roll_deg])
        x, y, z = points_mm.T
        across = np.cos(angle) * x - np.sin(angle) * z
        depth = np.sin(angle) * x + np.cos(angle) * z + self.distance_mm
        scale = self.zoom * SCALE_PX_PER_MM * self.distance_mm / depth
        u, v = scale * across, scale * y
        turned = np.column_stack([np.cos(roll) * u - np.sin(roll) * v, np.sin(roll) * u + np.cos(roll) * v])
        return turned + (np.array(SIZE_PX) - 1) / 2 + self.shift_px, scale


def eyes(views: int) -> tuple[Eye, ...]:
    """So many views, spread over the same angles."""
    return tuple(map(Eye, AZIMUTHS_DEG[views]))


def believed(views: Sequence[Eye], half_mm: Array) -> Calibration:
    """The calibration of views that nothing moved, good in a box of these half-widths (3,)."""
    cameras = [_camera(replace(eye, shift_px=(0.0, 0.0), zoom=1.0, roll_deg=0.0)) for eye in views]
    return droplet_calibration(cameras, half_mm)


def _camera(eye: Eye) -> PinholeCamera:
    """The matrices of the same view, which are all that the product is given."""
    sine, cosine = np.sin(np.radians(eye.azimuth_deg)), np.cos(np.radians(eye.azimuth_deg))
    focal_px = SCALE_PX_PER_MM * eye.distance_mm
    middle_u, middle_v = (np.array(SIZE_PX) - 1) / 2
    return PinholeCamera(
        camera_matrix=np.array([[focal_px, 0, middle_u], [0, focal_px, middle_v], [0, 0, 1.0]]),
        rotation=np.array([[cosine, 0, -sine], [0, 1, 0], [sine, 0, cosine]]),
        translation_mm=np.array([0, 0, eye.distance_mm]),
        image_size_px=SIZE_PX,
    )
