"""Whether the lines of sight of several views meet at the points of the target that they see."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from processing.calibration.calibration import ViewCalibration
from processing.calibration.fit.health import judge
from processing.calibration.observation import ViewObservations, stacked
from processing.calibration.triangulation import triangulate
from processing.calibration.verdict import Doubt, Verdict
from processing.geometry import FloatArray, ViewMapping

_SAME = 1e-6
"""Points are one if they differ by less, relative to the extent of all."""


def rays_miss_px(seen: Mapping[str, ViewObservations], mappings: Mapping[str, ViewMapping]) -> dict[str, float]:
    """Median distance by view between where it sees points and where all views that see them put them.

    Views are missing here that see no point that another view sees.
    """
    names = list(mappings)
    points_mm, image_px, sighted = _by_point([seen[name] for name in names])
    distances_px: dict[str, list[FloatArray]] = {name: [] for name in names}
    for together in np.unique(sighted, axis=0):
        views = np.flatnonzero(together)
        rows = np.flatnonzero((sighted == together).all(axis=1))
        if len(views) < 2:
            continue
        _, left_px = triangulate([mappings[names[view]] for view in views], image_px[rows][:, views], points_mm[rows])
        for number, view in enumerate(views):
            distances_px[names[view]].append(np.linalg.norm(left_px[:, number], axis=1))
    return {name: float(np.median(np.concatenate(px))) for name, px in distances_px.items() if px}


def check_rays(views: Mapping[str, ViewCalibration]) -> Iterator[Doubt]:
    """Views whose lines of sight miss those of the others by more than their hold-out error allows them."""
    for name, view in views.items():
        verdict = Verdict.GOOD if view.rays_miss_px is None else judge(view.rays_miss_px)
        if list(Verdict).index(verdict) > list(Verdict).index(view.verdict):
            yield Doubt(
                (name,),
                f"{name}: its lines of sight miss those of the other views by {view.rays_miss_px:.2g} px",
                verdict,
            )


def _by_point(seen: Sequence[ViewObservations]) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """All points (N, 3), where each view sees them (N, n, 2), and whether it does (N, n)."""
    of_views = [stacked(view.planes) for view in seen]
    all_mm = np.concatenate([points_mm for points_mm, _ in of_views])
    grain_mm = _SAME * max(float(np.ptp(all_mm, axis=0).max()), 1e-12)
    _, first, number = np.unique(np.round(all_mm / grain_mm), axis=0, return_index=True, return_inverse=True)
    image_px = np.zeros((len(first), len(seen), 2))
    sighted = np.zeros((len(first), len(seen)), dtype=np.bool_)
    start = 0
    for view, (points_mm, seen_px) in enumerate(of_views):
        rows = number.ravel()[start : start + len(points_mm)]
        image_px[rows, view], sighted[rows, view] = seen_px, True
        start += len(points_mm)
    return all_mm[first], image_px, sighted
