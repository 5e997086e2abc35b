"""Is a calibration to be trusted? Judged by points that the fit has not seen, never by its own residual."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from processing.calibration.calibration import PlaneError, Verdict
from processing.calibration.errors import CalibrationError
from processing.calibration.observation import PlaneObservation, stacked
from processing.geometry import FloatArray, ViewMapping

LIMITS_PX = {Verdict.GOOD: 0.05, Verdict.USABLE: 0.3, Verdict.WARN: 0.8}
"""Largest hold-out error of each verdict.

Of the droplets that are found, 3 % are ghosts at 0.5 px and half of them at 1 px (``study sensitivity``).
"""
MAX_REJECTED = 0.1
"""With a larger part of the points left out as wrong, a view is at best usable with a warning."""
MIN_DEPTH_RATIO = 0.02
"""Spread of the points along their flattest direction, relative to the widest one; less is as good as a plane."""
MIN_POINTS = 12
"""Points that a joint fit needs at the very least."""
MIN_PLANES = 4
"""With fewer planes, holding one out leaves too little of the depth: single points are held out instead."""
FOLDS = 5
"""Parts that are held out in turn."""

Fit = Callable[[Sequence[PlaneObservation]], ViewMapping]


def errors_px(mapping: ViewMapping, plane: PlaneObservation) -> FloatArray:
    """Back-projection errors (N,) of eq. 2: distance of projected from measured points."""
    return np.asarray(np.linalg.norm(mapping.project(plane.points_mm) - plane.image_px, axis=1), dtype=np.float64)


def plane_error(plane: PlaneObservation, distances_px: FloatArray) -> PlaneError:
    """Summary of the errors of one plane."""
    mean_px, rms_px = float(distances_px.mean()), float(np.sqrt((distances_px**2).mean()))
    return PlaneError(plane.z_mm, len(plane), mean_px, rms_px, plane.name)


def judge(holdout_error_px: float, rejected: float = 0.0) -> Verdict:
    """Verdict by hold-out error, and by the part of the points that was left out as wrong."""
    verdict = next((name for name, limit_px in LIMITS_PX.items() if holdout_error_px <= limit_px), Verdict.REFUSE)
    doubtful = rejected > MAX_REJECTED and verdict in (Verdict.GOOD, Verdict.USABLE)
    return Verdict.WARN if doubtful else verdict


def check_motion(view: str, planes: Sequence[PlaneObservation]) -> None:
    """Refuse targets that cannot determine a camera: too few points, or all in one plane.

    Raises
    ------
    CalibrationError
        Names view, value and limit.
    """
    problem = degeneracy(planes)
    if problem is not None:
        raise CalibrationError(f"{view}: {problem}")


def degeneracy(planes: Sequence[PlaneObservation]) -> str | None:
    """Why these points do not determine a camera; None where they do."""
    n_points = sum(len(plane) for plane in planes)
    if n_points < MIN_POINTS:
        return f"{n_points} points are too few, at least {MIN_POINTS} are needed"
    points_mm, _ = stacked(planes)
    spread_mm = np.linalg.svd(points_mm - points_mm.mean(axis=0), compute_uv=False) / np.sqrt(n_points)
    ratio = spread_mm[2] / spread_mm[0]
    if ratio >= MIN_DEPTH_RATIO:
        return None
    z_range_mm = float(np.ptp(points_mm[:, 2]))
    return (
        f"the target hardly moved: its points lie within {spread_mm[2]:.3g} mm of one plane "
        f"(z range {z_range_mm:.3g} mm), "
        f"{100 * ratio:.2g} % of their extent; a camera needs {100 * MIN_DEPTH_RATIO:.0f} %"
    )


def holdout_error_px(planes: Sequence[PlaneObservation], fit: Fit) -> float:
    """Mean error of points that were held out of the fit, each point once; see ``holdout_distances_px``."""
    return float(holdout_distances_px(planes, fit).mean())


def holdout_distances_px(planes: Sequence[PlaneObservation], fit: Fit) -> FloatArray:
    """Errors (N,) of points that were held out of the fit, each point once, in an order that the planes alone decide.

    Whole planes are held out where the others still determine the camera, else every fifth point.

    Parameters
    ----------
    planes : sequence of PlaneObservation
        Points that count.
    fit : callable
        Fits a mapping to planes; may raise CalibrationError.
    """
    folds = list(_plane_folds(planes))
    if len(planes) < MIN_PLANES or any(degeneracy(training) for training, _ in folds):
        folds = list(_point_folds(planes))
    distances_px = []
    for training, held_out in folds:
        mapping = fit(training)
        distances_px += [errors_px(mapping, plane) for plane in held_out if len(plane)]
    return np.concatenate(distances_px)


def outline_mm(planes: Sequence[PlaneObservation]) -> tuple[tuple[float, float], ...]:
    """Convex outline (x, y) of all points, counter-clockwise."""
    points_mm = stacked(planes)[0][:, :2]
    try:
        corners = points_mm[ConvexHull(points_mm).vertices]
    except QhullError:
        corners = points_mm[[0, -1]]
    return tuple((float(x), float(y)) for x, y in corners)


def _plane_folds(
    planes: Sequence[PlaneObservation],
) -> Iterator[tuple[list[PlaneObservation], list[PlaneObservation]]]:
    for fold in range(min(FOLDS, len(planes))):
        held_out = [plane for number, plane in enumerate(planes) if number % FOLDS == fold]
        yield [plane for plane in planes if plane not in held_out], held_out


def _point_folds(
    planes: Sequence[PlaneObservation],
) -> Iterator[tuple[list[PlaneObservation], list[PlaneObservation]]]:
    for fold in range(FOLDS):
        chosen = [_every_fifth(len(plane), fold) for plane in planes]
        training = [plane.select(~mask) for plane, mask in zip(planes, chosen, strict=True)]
        yield training, [plane.select(mask) for plane, mask in zip(planes, chosen, strict=True)]


def _every_fifth(n_points: int, fold: int) -> NDArray[np.bool_]:
    return np.asarray(np.arange(n_points) % FOLDS == fold, dtype=np.bool_)
