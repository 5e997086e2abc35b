"""The rig of the paper: Table 1, and its four views as cameras and optics."""

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from processing.geometry import PinholeCamera, view_camera
from processing.synthetic.view_optics import ViewOptics

PIXEL_PITCH_UM = 7.4
IMAGE_SCALE_PX_PER_MM = 60.0
IMAGE_SIZE_PX = (1600, 1200)


@dataclass(frozen=True)
class TableRow:
    """A row of Table 1: angle, lens, Airy disk on the sensor, and LED current of a view."""

    azimuth_deg: float
    f_number: float
    focal_length_mm: float
    magnification: float
    airy_diameter_um: float
    current_a: float


TABLE_1 = MappingProxyType(
    {
        "view1": TableRow(45.0, 22.0, 100.0, 0.45, 39.0, 25.0),
        "view2": TableRow(15.0, 16.0, 85.0, 0.43, 28.0, 9.9),
        "view3": TableRow(-15.0, 16.0, 85.0, 0.44, 28.0, 10.0),
        "view4": TableRow(-45.0, 22.0, 100.0, 0.43, 38.0, 26.0),
    }
)

_DISTORTIONS = {
    "view1": (0.6, 20, 0.0008, -0.0006, 0),
    "view2": (-0.5, 10, -0.0006, 0.0008, 0),
    "view3": (0.6, 0, 0.0004, 0.001, 0),
    "view4": (-0.6, 10, 0.001, 0.0004, 0),
}
_PRINCIPAL_OFFSETS_PX = {"view1": (180, -20), "view2": (60, 15), "view3": (-60, 10), "view4": (-180, -15)}
"""What the table does not give: distortion, and where the optical axis meets the sensor."""


def paper_cameras(binning: int = 1) -> dict[str, PinholeCamera]:
    """The four views at 45, 15, -15 and -45 degrees, 60 px/mm, 1600 x 1200; up to 1.5 to 3 px distorted at the corners.

    Parameters
    ----------
    binning : int
        Pixels binned in either direction: the same views with smaller images, for quick tests.
    """
    width_px, height_px = (size // binning for size in IMAGE_SIZE_PX)
    return {
        name: view_camera(
            view.azimuth_deg,
            focal_length_mm=view.focal_length_mm,
            magnification=view.magnification,
            scale_px_per_mm=IMAGE_SCALE_PX_PER_MM / binning,
            image_size_px=(width_px, height_px),
            distortion=np.array(_DISTORTIONS[name]),
            principal_offset_px=(_PRINCIPAL_OFFSETS_PX[name][0] / binning, _PRINCIPAL_OFFSETS_PX[name][1] / binning),
        )
        for name, view in TABLE_1.items()
    }


def paper_optics(binning: int = 1) -> dict[str, ViewOptics]:
    """Lens, pixel pitch and nominal current of the four views (Table 1)."""
    return {
        name: ViewOptics(
            view.f_number, view.focal_length_mm, view.magnification, PIXEL_PITCH_UM * binning, view.current_a
        )
        for name, view in TABLE_1.items()
    }
