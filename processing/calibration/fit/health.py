"""Is a calibration to be trusted? Judged by points that the fit has not seen, never by its own residual."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from processing.calibration.calibration import PlaneError
from processing.calibration.errors import CalibrationError
from processing.calibration.observation import PlaneObservation, stacked
from processing.calibration.verdict import Verdict
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
"""Points that a fit needs at the very least."""
MIN_PLANES = 4
"""With fewer planes, holding one out leaves too little of the depth: single points are held out instead."""
FOLDS = 5
"""Parts that are held out in turn."""
STILL, STILL_PX, MOST_STILL_PX = 3.0, 0.02, 1.0
"""Where x and y alone describe the images to so many times what the camera leaves, or so well, z does not show."""
STEPPED = 0.5
"""But of a solid target, z too follows from x and y, to this part of its spread: it need not move."""

Fit = Callable[[Sequence[PlaneObservation]], ViewMapping]
HeldOut = list[NDArray[np.bool_]]
"""Which points (N,) of every plane are held out."""


def errors_px(mapping: ViewMapping, plane: PlaneObservation) -> FloatArray:
    """Back-projection errors (N,) of eq. 2: distance of projected from measured points."""
    return np.asarray(np.linalg.norm(mapping.project(plane.points_mm) - plane.image_px, axis=1), dtype=np.float64)


def plane_error(plane: PlaneObservation, distances_px: FloatArray, holdout_px: FloatArray) -> PlaneError:
    """Summary of one plane: errors (N,) of its points, and those of the points that were held out of the fit."""
    return PlaneError(
        name=plane.name,
        z_mm=plane.z_mm,
        n_points=len(plane),
        mean_error_px=float(distances_px.mean()),
        rms_px=float(np.sqrt((distances_px**2).mean())),
        max_error_px=float(distances_px.max()),
        holdout_error_px=float(holdout_px.mean()),
    )


def judge(holdout_error_px: float, rejected: float = 0.0) -> Verdict:
    """Verdict by hold-out error, and by the part of the points that was left out as wrong."""
    verdict = next((name for name, limit_px in LIMITS_PX.items() if holdout_error_px <= limit_px), Verdict.REFUSE)
    doubtful = rejected > MAX_REJECTED and verdict in (Verdict.GOOD, Verdict.USABLE)
    return Verdict.WARN if doubtful else verdict


def shortfalls(holdout_error_px: float, n_rejected: int, n_points: int) -> tuple[str, ...]:
    """Why ``judge`` does not call this good, of so many points left out and used; nothing where it does."""
    exceeded_px = [limit_px for limit_px in LIMITS_PX.values() if holdout_error_px > limit_px]
    reasons = [f"hold-out error {holdout_error_px:.3g} px, above {limit_px:g} px" for limit_px in exceeded_px[-1:]]
    rejected = n_rejected / (n_rejected + n_points)
    if rejected > MAX_REJECTED:
        reasons.append(
            f"{n_rejected} of {n_rejected + n_points} points were left out as wrong, {100 * rejected:.0f} %, "
            f"more than {100 * MAX_REJECTED:.0f} %"
        )
    return tuple(reasons)


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


def check_seen_motion(mapping: ViewMapping, points_mm: FloatArray, image_px: FloatArray) -> None:
    """Refuse images that do not depend on where the target stood: it did not move, or they are one image.

    Parameters
    ----------
    mapping : ViewMapping
        The fit.
    points_mm, image_px : (N, 3) and (N, 2) arrays
        The points it was fitted to.

    Raises
    ------
    CalibrationError
        A map of x and y alone describes the images as well as the fit does.
    """
    left_px = float(np.sqrt(((mapping.project(points_mm) - image_px) ** 2).sum(axis=1).mean()))
    flat_px = _left_by_x_and_y(points_mm, image_px)
    solid = _left_by_x_and_y(points_mm, points_mm[:, 2:]) < STEPPED * points_mm[:, 2].std()
    if solid or flat_px > np.clip(STILL * left_px, STILL_PX, MOST_STILL_PX):
        return
    raise CalibrationError(
        f"what it sees does not depend on z: {np.ptp(points_mm[:, 2]):.3g} mm along z change it by {flat_px:.2g} px. "
        "Did the target not move, or is one image, or one page of a stack, named for all planes?"
    )


def _left_by_x_and_y(points_mm: FloatArray, values: FloatArray) -> float:
    """What a polynomial in x and y leaves of values (N, k), rms per point, the freedom of its terms counted out."""
    order = 3 if len(points_mm) >= 40 else 2
    x, y = ((points_mm - points_mm.mean(axis=0)) / max(float(points_mm[:, :2].std()), 1e-12)).T[:2]
    terms = np.stack([x**i * y**j for i in range(order + 1) for j in range(order + 1 - i)], axis=1)
    left = values - terms @ np.linalg.lstsq(terms, values, rcond=None)[0]
    return float(np.sqrt((left**2).sum() / max(len(terms) - terms.shape[1], 1)))


def holdout_distances_px(planes: Sequence[PlaneObservation], fit: Fit) -> list[FloatArray]:
    """Errors (N,) of the points of every plane, each held out of the fit once.

    Whole planes are held out where the others still determine the camera, else every fifth point.

    Parameters
    ----------
    planes : sequence of PlaneObservation
        Points that count.
    fit : callable
        Fits a mapping to planes; may raise CalibrationError.
    """
    folds = _plane_folds(planes)
    if len(planes) < MIN_PLANES or any(degeneracy(_training(planes, held_out)) for held_out in folds):
        folds = _point_folds(planes)
    distances_px = [np.zeros(len(plane)) for plane in planes]
    for held_out in folds:
        mapping = fit(_training(planes, held_out))
        for plane, mask, distance_px in zip(planes, held_out, distances_px, strict=True):
            if mask.any():
                distance_px[mask] = errors_px(mapping, plane.select(mask))
    return distances_px


def outline_mm(planes: Sequence[PlaneObservation]) -> tuple[tuple[float, float], ...]:
    """Convex outline (x, y) of all points, counter-clockwise."""
    points_mm = stacked(planes)[0][:, :2]
    try:
        corners = points_mm[ConvexHull(points_mm).vertices]
    except QhullError:
        corners = points_mm[[0, -1]]
    return tuple((float(x), float(y)) for x, y in corners)


def _plane_folds(planes: Sequence[PlaneObservation]) -> list[HeldOut]:
    return [
        [np.full(len(plane), number % FOLDS == fold) for number, plane in enumerate(planes)]
        for fold in range(min(FOLDS, len(planes)))
    ]


def _point_folds(planes: Sequence[PlaneObservation]) -> list[HeldOut]:
    return [[np.arange(len(plane)) % FOLDS == fold for plane in planes] for fold in range(FOLDS)]


def _training(planes: Sequence[PlaneObservation], held_out: HeldOut) -> list[PlaneObservation]:
    """What is left for the fit; planes that are held out as a whole are not mentioned."""
    return [plane.select(~mask) for plane, mask in zip(planes, held_out, strict=True) if not mask.all()]
