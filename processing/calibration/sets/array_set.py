"""A calibration set from images that are in memory: of every view, the target at known positions."""

from collections.abc import Collection, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from processing.calibration.observation import CalibrationSet
from processing.calibration.sets.plane_detection import PlaneImage, detect_planes
from processing.calibration.target.targets import Target
from processing.kernels import _native
from processing.masked import require_unmasked


def find_target(
    images: Mapping[str, Mapping[float, NDArray[Any]]],
    target: Target,
    *,
    origin_px: Mapping[str, tuple[float, float]] | None = None,
    azimuth_deg: Mapping[str, float] | None = None,
    roll_deg: Mapping[str, float] | None = None,
) -> CalibrationSet:
    """Find the points of a target in images of it, for ``calibrate``.

    Parameters
    ----------
    images : mapping of view to mapping of z_mm to (rows, columns) array
        Grey values of uint8, uint16 or float32; the target stands across z at each ``z_mm``. Two to eight views.
    target : Target
        ``Checkerboard`` or ``Dots``.
    origin_px : mapping of view to (u, v), optional
        Where the target's origin is seen, roughly. Not needed where the board is seen whole, or has a marker.
    azimuth_deg : mapping of view to angle, optional
        Where the views stand, roughly. State it: it finds mistakes that fit as well as the truth.
    roll_deg : mapping of view to angle, optional
        How cameras are turned about their axes; the others count as upright.

    Returns
    -------
    CalibrationSet
        Points (u, v) in px and where they are in mm; ``notes`` says which images were left out, and why.

    Raises
    ------
    CalibrationError
        A view never sees the target, or its images differ in size; names the view.
    ValueError
        Too many views, something is stated of another view or is not finite, or an image has masked pixels.
    """
    if not 1 <= len(images) <= _native.MAX_VIEWS:
        raise ValueError(f"{len(images)} views, a calibration takes 1 to {_native.MAX_VIEWS}")
    for stated in (origin_px, azimuth_deg, roll_deg):
        _require_stated(stated or {}, images)
    origins_px, rolls_deg = dict(origin_px or {}), dict(roll_deg or {})
    for view, by_z in images.items():
        for z_mm, image in by_z.items():
            require_unmasked(f"{view}, z = {_named(z_mm)} mm", image)
    planes = [
        PlaneImage(view, _named(z_mm), f"z = {_named(z_mm)} mm", z_mm, partial(_kept, image), origins_px.get(view))
        for view, by_z in images.items()
        for z_mm, image in sorted(by_z.items())
    ]
    found = detect_planes("images", planes, target, rolls_deg)
    return CalibrationSet("images", target, found.views, found.notes, dict(azimuth_deg or {}), rolls_deg)


def _require_stated(stated: Mapping[str, float | tuple[float, float]], views: Collection[str]) -> None:
    for name, value in stated.items():
        if name not in views:
            raise ValueError(f"{name}: something is stated of it, and images are of {', '.join(views)}")
        if not np.isfinite(value).all():
            raise ValueError(f"{name}: {value} is stated of it, which is not finite")


def _named(z_mm: float) -> str:
    return f"{z_mm:g}"


def _kept(image: NDArray[Any]) -> NDArray[Any]:
    return image
