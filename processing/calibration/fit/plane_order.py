"""Have two planes of the target been exchanged? A fit puts up with them, and its camera seems to ask for a pitch."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np

from processing.calibration.calibration import ViewCalibration
from processing.calibration.fit.pinhole_fit import direct_linear_transformation, projected_px
from processing.calibration.observation import CalibrationSet, PlaneObservation, stacked
from processing.calibration.verdict import Doubt, Verdict

CLEARER = 4.0
"""So many times as well must points fit once two planes are exchanged."""
LEAST_PLANES = 3
"""Of two, the exchanged ones are those of a mirrored view."""


def check_plane_order(calibration_set: CalibrationSet, views: Mapping[str, ViewCalibration]) -> Iterator[Doubt]:
    """Two planes whose exchange explains why views do not predict unseen points."""
    found: dict[tuple[float, float], list[str]] = {}
    for name, view in views.items():
        planes = calibration_set.views[name].planes
        if view.verdict in (Verdict.WARN, Verdict.REFUSE) and (exchanged := _exchanged_planes(planes)):
            found.setdefault(exchanged, []).append(name)
    for (one_mm, other_mm), names in found.items():
        yield Doubt(
            tuple(names),
            f"have the planes at z {one_mm:g} and {other_mm:g} mm been exchanged? Then the points of "
            f"{', '.join(names)} would fit more than {CLEARER:g} times as well",
            Verdict.REFUSE,
        )


def _exchanged_planes(planes: Sequence[PlaneObservation]) -> tuple[float, float] | None:
    """Positions of the two planes that must be exchanged for the points to fit; None where that explains nothing."""
    places_mm = [float(plane.points_mm[0, 2]) for plane in planes]
    if len(set(places_mm)) < LEAST_PLANES or any(np.ptp(plane.points_mm[:, 2]) > 0 for plane in planes):
        return None
    given_px = _left_px(planes, {})
    left_px = {
        (one, other): _left_px(planes, {one: other, other: one})
        for one, other in combinations(sorted(set(places_mm)), 2)
    }
    best, second = sorted(left_px, key=lambda pair: left_px[pair])[:2]
    clear = CLEARER * left_px[best] < min(given_px, left_px[second])
    return best if clear else None


def _left_px(planes: Sequence[PlaneObservation], moved_mm: Mapping[float, float]) -> float:
    """What a projection leaves of the images, rms, where planes stand elsewhere."""
    points_mm, image_px = stacked(planes)
    points_mm = points_mm.copy()
    points_mm[:, 2] = [moved_mm.get(z_mm, z_mm) for z_mm in points_mm[:, 2].tolist()]
    projection = direct_linear_transformation(points_mm, image_px, np.ones(len(points_mm)))
    return float(np.sqrt(np.mean((projected_px(projection, points_mm) - image_px) ** 2)))
