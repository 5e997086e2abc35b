"""The four views of the paper (Table 1) as cameras and optics."""

from dataclasses import dataclass

import numpy as np

from processing.geometry import PinholeCamera, view_camera
from processing.synthetic.view_optics import ViewOptics

PIXEL_PITCH_UM = 7.4
IMAGE_SCALE_PX_PER_MM = 60.0
IMAGE_SIZE_PX = (1600, 1200)


@dataclass(frozen=True)
class _PaperView:
    """A row of Table 1, with the distortion and the offset of the optical axis that the table does not give."""

    azimuth_deg: float
    f_number: float
    focal_length_mm: float
    magnification: float
    current_a: float
    distortion: tuple[float, float, float, float, float]
    principal_offset_px: tuple[float, float]


_VIEWS = {
    "view1": _PaperView(45, 22, 100, 0.45, 25, (0.6, 20, 0.0008, -0.0006, 0), (180, -20)),
    "view2": _PaperView(15, 16, 85, 0.43, 9.9, (-0.5, 10, -0.0006, 0.0008, 0), (60, 15)),
    "view3": _PaperView(-15, 16, 85, 0.44, 10, (0.6, 0, 0.0004, 0.001, 0), (-60, 10)),
    "view4": _PaperView(-45, 22, 100, 0.43, 26, (-0.6, 10, 0.001, 0.0004, 0), (-180, -15)),
}


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
            distortion=np.array(view.distortion),
            principal_offset_px=(view.principal_offset_px[0] / binning, view.principal_offset_px[1] / binning),
        )
        for name, view in _VIEWS.items()
    }


def paper_optics(binning: int = 1) -> dict[str, ViewOptics]:
    """Lens, pixel pitch and nominal current of the four views (Table 1)."""
    return {
        name: ViewOptics(
            view.f_number, view.focal_length_mm, view.magnification, PIXEL_PITCH_UM * binning, view.current_a
        )
        for name, view in _VIEWS.items()
    }
