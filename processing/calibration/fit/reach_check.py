"""How well each view is known where volumes are made: in all of the calibrated box, not at its own points alone."""

from collections.abc import Iterator, Mapping

import numpy as np

from processing.calibration.calibration import ViewCalibration
from processing.calibration.fit.covariance import position_std_px
from processing.calibration.fit.health import LIMITS_PX
from processing.calibration.verdict import Doubt, Verdict
from processing.geometry import FloatArray

_STEPS = (7, 7, 3)
"""Of the box along x, y and z, faces included: errors are largest at its corners."""


def check_reach(views: Mapping[str, ViewCalibration], z_range_mm: tuple[float, float]) -> Iterator[Doubt]:
    """Views whose points determine them in a part of the box only, by the deviation they leave elsewhere."""
    points_mm = _seen_by_all(views, _lattice_mm(views, z_range_mm))
    if not len(points_mm):
        return
    for name, view in views.items():
        std_px = position_std_px(view, points_mm)
        if std_px is None or std_px.max() <= LIMITS_PX[Verdict.USABLE]:
            continue
        yield Doubt((name,), _told(name, points_mm[np.argmax(std_px)], float(std_px.max())))


def _told(name: str, point_mm: FloatArray, std_px: float) -> str:
    x_mm, y_mm, z_mm = point_mm
    return (
        f"{name}: where it sees what is at x {x_mm:.3g}, y {y_mm:.3g}, z {z_mm:.3g} mm is known to {std_px:.2g} px (one"
        f" standard deviation), more than {LIMITS_PX[Verdict.USABLE]:g} px: its points leave that part of "
        "the volume out. More points or positions there, or a smaller box (--grid)?"
    )


def _lattice_mm(views: Mapping[str, ViewCalibration], z_range_mm: tuple[float, float]) -> FloatArray:
    """Points (N, 3) of the box that holds the target's points of all views."""
    outline_mm = np.array([corner for view in views.values() for corner in view.extent_mm])
    ranges_mm = (*zip(outline_mm.min(axis=0), outline_mm.max(axis=0), strict=True), z_range_mm)
    axes_mm = [np.linspace(*range_mm, steps) for range_mm, steps in zip(ranges_mm, _STEPS, strict=True)]
    return np.stack(np.meshgrid(*axes_mm, indexing="ij"), axis=-1).reshape(-1, 3)


def _seen_by_all(views: Mapping[str, ViewCalibration], points_mm: FloatArray) -> FloatArray:
    seen = np.ones(len(points_mm), dtype=np.bool_)
    for view in views.values():
        image_px = view.mapping.project(points_mm)
        seen &= np.all((image_px >= 0) & (image_px <= np.array(view.mapping.image_size_px) - 1), axis=1)
    return points_mm[seen]
