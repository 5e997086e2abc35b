"""Partly visible targets: which of its points these are follows from what the same view sees at other positions."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from processing.calibration.errors import TargetNotFound
from processing.calibration.fit.pinhole_fit import direct_linear_transformation, projected_px
from processing.calibration.observation import PlaneObservation, stacked
from processing.calibration.target.targets import Target, TargetPoints, detect_target
from processing.geometry import FloatArray

MIN_KNOWN_PLANES = 2
"""One plane does not tell which way the target goes in the image when the stage moves."""
MAX_DEVIATION = 0.25
"""So many steps of the grid may the points lie beside the places where the other positions expect them."""


def detect_by_others(
    image: NDArray[np.generic], target: Target, z_mm: float, known: Sequence[PlaneObservation], roll_deg: float = 0.0
) -> TargetPoints:
    """Find the points of a target of known size of which a part is seen.

    Parameters
    ----------
    image : (rows, columns) array
        Grey values.
    target : Target
        With columns and rows.
    z_mm : float
        Position of the target.
    known : sequence of PlaneObservation
        What the view sees at other positions, with known places.
    roll_deg : float
        As for ``detect_target``.

    Raises
    ------
    TargetNotFound
        Too few positions are known, or what is seen does not lie where they say.
    """
    if target.columns is None:
        raise TargetNotFound("other positions would tell if columns and rows of the target were given")
    positions = len({plane.z_mm for plane in known})
    if positions < MIN_KNOWN_PLANES:
        raise TargetNotFound(
            f"{positions} other positions are known, {MIN_KNOWN_PLANES} would tell; "
            "say where the origin is seen at two positions"
        )
    ids = target.board_ids()
    expected_px = _predict(known, target, ids, z_mm)
    inside = np.all((expected_px >= 0) & (expected_px <= np.array(image.shape[::-1]) - 1), axis=1)
    if not inside.any():
        raise TargetNotFound("the other positions say that the target lies outside the image")
    visible, visible_px = ids[inside], expected_px[inside]
    middle = int(np.argmin(np.linalg.norm(visible_px - visible_px.mean(axis=0), axis=1)))
    u_px, v_px = (float(value) for value in visible_px[middle])
    found = detect_target(image, target, (u_px, v_px), roll_deg)
    points = TargetPoints(found.ids + visible[middle], found.image_px)
    _check(points, _predict(known, target, points.ids, z_mm), visible_px)
    return points


def _predict(known: Sequence[PlaneObservation], target: Target, ids: NDArray[np.int64], z_mm: float) -> FloatArray:
    """Where a camera through the known planes sees points (N, 2) of the target."""
    points_mm, image_px = stacked(known)
    projection = direct_linear_transformation(points_mm, image_px, np.ones(len(points_mm)))
    return projected_px(projection, np.column_stack([target.points_mm(ids), np.full(len(ids), z_mm)]))


def _check(points: TargetPoints, expected_px: FloatArray, visible_px: FloatArray) -> None:
    step_px = float(np.median(np.linalg.norm(np.diff(visible_px, axis=0), axis=1))) if len(visible_px) > 1 else 1.0
    deviation_px = float(np.median(np.linalg.norm(points.image_px - expected_px, axis=1)))
    if deviation_px > MAX_DEVIATION * step_px:
        raise TargetNotFound(
            f"its points lie {deviation_px:.1f} px beside where the other positions say, "
            f"at most {MAX_DEVIATION * step_px:.1f} px are allowed"
        )
