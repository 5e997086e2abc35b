"""Does a view see the target's axes as they are, or as in a mirror? Its lines of sight tell, if they diverge enough.

Planes in reverse order, a stage that counts the other way, a mirror before the camera, u and v or x and y exchanged,
v counted from the bottom: each turns a right-handed world into a left-handed one, and each fits perfectly.
"""

from collections.abc import Mapping

import numpy as np

from processing.calibration.calibration import ViewCalibration
from processing.calibration.errors import CalibrationError
from processing.calibration.fit.placement import CLEARER_DEG, line_angle_deg, sight_azimuth_deg
from processing.calibration.observation import CalibrationSet, stacked
from processing.calibration.triangulation import linearise
from processing.geometry import FloatArray, ViewMapping

CERTAIN = 10.0
"""Perspective shows in the image by so many times the uncertainty of a mean over all points."""
MAX_POINTS = 200
"""Points of the target at which lines of sight are looked at; more would only take longer."""


def handedness(mapping: ViewMapping, points_mm: FloatArray, rms_px: float) -> int:
    """1 where a view sees the axes of its points as they are, -1 where as in a mirror, 0 where nothing tells.

    The gradients of u and v span a plane across the line of sight; in a right-handed world their cross product leads
    away from the camera, where everything looks smaller.

    Parameters
    ----------
    mapping : ViewMapping
        The view, of any kind.
    points_mm : (N, 3) array
        What it was fitted to.
    rms_px : float
        What the fit left.
    """
    some_mm = points_mm[:: max(1, len(points_mm) // MAX_POINTS)]
    areas = _image_areas(mapping, some_mm)
    lengths = np.linalg.norm(areas, axis=1)
    ahead = areas / lengths[:, None]
    middle, beside_mm = ahead.mean(axis=0), some_mm - some_mm.mean(axis=0)
    deep_mm, wide_mm = float((beside_mm @ middle).std()), float(np.sqrt((beside_mm**2).sum(axis=1).mean()))
    far, near = (
        np.linalg.norm(_image_areas(mapping, some_mm + step_mm * ahead), axis=1) for step_mm in (deep_mm, -deep_mm)
    )
    growth = float(np.log(far / near).mean()) / 2
    shift_px = abs(growth) / 2 * wide_mm * float(np.sqrt(lengths.mean()))
    certain = shift_px > CERTAIN * rms_px / np.sqrt(len(points_mm))
    return int(-np.sign(growth)) if certain else 0


def check_handedness(calibration_set: CalibrationSet, views: Mapping[str, ViewCalibration]) -> list[str]:
    """Views of which nothing tells; refuses those that see the target as in a mirror although nobody said so.

    Raises
    ------
    CalibrationError
        Names the views, what agrees with the rig, and what to ask oneself.
    """
    found = {
        name: handedness(view.mapping, stacked(calibration_set.views[name].planes)[0], view.rms_px)
        for name, view in views.items()
    }
    said = {name: -1 if name in calibration_set.mirrored else 1 for name in views}
    wrong = [name for name in views if found[name] == -said[name]]
    if wrong:
        raise CalibrationError(_refusal(calibration_set, views, wrong, [name for name in views if found[name]]))
    return [name for name in views if not found[name]]


def _image_areas(mapping: ViewMapping, points_mm: FloatArray) -> FloatArray:
    """Cross products (N, 3) of the gradients of u and v, in px^2/mm^2."""
    slopes = linearise(mapping, points_mm)[1]
    return np.asarray(np.cross(slopes[:, 0], slopes[:, 1]), dtype=np.float64)


def _refusal(
    calibration_set: CalibrationSet, views: Mapping[str, ViewCalibration], wrong: list[str], told: list[str]
) -> str:
    names = ", ".join(wrong)
    if unmirrored := [name for name in wrong if name in calibration_set.mirrored]:
        return f"{', '.join(unmirrored)}: said to look by a mirror (mirrored), but sees the target's axes as they are"
    if wrong == told:
        text = f"{names}: the target's axes are left-handed, so volumes would come out mirrored. Does "
    else:
        others = ", ".join(name for name in told if name not in wrong)
        text = f"{names}: left-handed, as if the target were seen in a mirror, unlike {others}. Does "
    return text + ", or ".join(_questions(calibration_set, views, wrong, alone=wrong != told)) + "?"


def _questions(
    calibration_set: CalibrationSet, views: Mapping[str, ViewCalibration], wrong: list[str], *, alone: bool
) -> list[str]:
    """What turns handedness over, the likely ones first: those with which the azimuth of the rig agrees."""
    names = ", ".join(f'"{name}"' for name in wrong)
    of_depth = [
        "z_mm count the other way, as the planes are named in reverse order"
        if alone
        else "z count the other way (towards the views)"
    ]
    of_image = [
        f"the view look by a mirror (mirrored = [{names}])" if alone else "each view look by a mirror (mirrored)"
    ]
    if calibration_set.target is None:
        of_image += ['v count from the bottom (v_axis = "up")', "a table have u and v, or x and y, exchanged"]
    if not alone:
        of_image.append('y point up (y_axis = "up")' if calibration_set.target else "y point up")
    in_place = _in_place(calibration_set, views, wrong)
    likely_image = calibration_set.target is None if in_place is None else in_place
    return of_image + of_depth if likely_image else of_depth + of_image


def _in_place(calibration_set: CalibrationSet, views: Mapping[str, ViewCalibration], wrong: list[str]) -> bool | None:
    """Whether views that are left-handed stand where the rig says, so that their z is right; None where it does not."""
    said_deg, middle_mm = calibration_set.azimuths_deg, calibration_set.middle_mm
    off_deg = [
        line_angle_deg(sight_azimuth_deg(views[name].mapping, middle_mm) - said_deg[name])
        for name in wrong
        if name in said_deg
    ]
    return bool(max(off_deg) < CLEARER_DEG) if off_deg else None
