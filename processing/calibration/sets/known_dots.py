"""Dots of a solid target at known places in space, found from a few that somebody pointed at.

Many dots may be hidden, and other bright specks may lie about: dots are looked for where a camera fitted
to those found so far expects them, in ever smaller circles.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.calibration.errors import TargetNotFound
from processing.calibration.fit.health import MIN_DEPTH_RATIO
from processing.calibration.fit.pinhole_fit import direct_linear_transformation, projected_px
from processing.geometry import FloatArray

MIN_SEEDS = 6
"""A direct linear transformation needs six points."""
SEARCH_DIAMETERS = (2.0, 1.0, 0.7, 0.5)
"""Radius of the search around the expected place, in dot diameters, step by step."""
MIN_SIGNAL = 0.25
"""A dot shows at least this part of the median signal of the seeds."""


@dataclass(frozen=True, eq=False)
class KnownDots:
    """Dots that were found.

    Parameters
    ----------
    indices : (N,) array
        Which of the known points they are.
    image_px : (N, 2) array
        Where they are seen (u, v).
    """

    indices: NDArray[np.int64]
    image_px: FloatArray


def find_known_dots(
    image: NDArray[np.generic], points_mm: FloatArray, seeds_px: Mapping[int, tuple[float, float]], diameter_px: float
) -> KnownDots:
    """Find the dots of a solid target.

    Parameters
    ----------
    image : (rows, columns) array
        Bright dots.
    points_mm : (N, 3) array
        Where all dots are.
    seeds_px : mapping of int to (u, v)
        Where some of them (indices) are seen, to about a diameter; six or more, not all in one plane.
    diameter_px : float
        Size of a dot in the image.

    Raises
    ------
    TargetNotFound
        There are too few seeds, or too few dots at the seeds.
    """
    if len(seeds_px) < MIN_SEEDS:
        raise TargetNotFound(f"{len(seeds_px)} seeds, at least {MIN_SEEDS} are needed")
    peaks_px, signal = _specks(np.ascontiguousarray(image, dtype=np.float32), diameter_px)
    indices = np.fromiter(seeds_px, np.int64, len(seeds_px))
    spread_mm = np.linalg.svd(points_mm[indices] - points_mm[indices].mean(axis=0), compute_uv=False)
    if spread_mm[2] < MIN_DEPTH_RATIO * spread_mm[0]:
        raise TargetNotFound("the seeds lie in one plane: seeds_px must name dots at different depths")
    expected_px = np.array([seeds_px[int(index)] for index in indices], dtype=np.float64)
    seed_signal = [signal[near].max() for near in _near(expected_px, peaks_px, diameter_px) if len(near)]
    enough = MIN_SIGNAL * float(np.median(seed_signal)) if seed_signal else np.inf
    bright_px = peaks_px[signal > enough]
    found = _nearest(expected_px, bright_px, SEARCH_DIAMETERS[0] * diameter_px)
    for search in SEARCH_DIAMETERS:
        if (found >= 0).sum() < MIN_SEEDS:
            raise TargetNotFound(f"{(found >= 0).sum()} dots where {MIN_SEEDS} or more are expected")
        seen = found >= 0
        expected_px = _project(points_mm[indices[seen]], bright_px[found[seen]], points_mm)
        indices = np.arange(len(points_mm))
        found = _nearest(expected_px, bright_px, search * diameter_px)
    seen = found >= 0
    return KnownDots(indices[seen], bright_px[found[seen]])


def _specks(image: NDArray[np.float32], diameter_px: float) -> tuple[FloatArray, FloatArray]:
    """Bright specks about as large as a dot: sub-pixel positions (N, 2) and signals (N,)."""
    sigma_px = diameter_px / 4
    signal = cv2.GaussianBlur(image, (0, 0), sigma_px) - cv2.GaussianBlur(image, (0, 0), 2.5 * sigma_px)
    window = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * round(diameter_px / 2) + 1,) * 2)
    rows, columns = np.nonzero((signal >= cv2.dilate(signal, window)) & (signal > 0))
    inside = (rows > 0) & (columns > 0) & (rows < image.shape[0] - 1) & (columns < image.shape[1] - 1)
    rows, columns = rows[inside], columns[inside]
    here = signal[rows, columns]
    u = columns + _vertex(signal[rows, columns - 1], here, signal[rows, columns + 1])
    v = rows + _vertex(signal[rows - 1, columns], here, signal[rows + 1, columns])
    return np.column_stack([u, v]), here.astype(np.float64)


def _vertex(before: NDArray[np.floating], here: NDArray[np.floating], after: NDArray[np.floating]) -> FloatArray:
    """Offset of the vertex of a parabola through three samples."""
    curvature = np.maximum(2.0 * here - before - after, 1e-6)
    return np.asarray(np.clip((after - before) / (2 * curvature), -0.5, 0.5), dtype=np.float64)


def _project(seen_mm: FloatArray, seen_px: FloatArray, points_mm: FloatArray) -> FloatArray:
    projection = direct_linear_transformation(seen_mm, seen_px, np.ones(len(seen_mm)))
    return projected_px(projection, points_mm)


def _near(expected_px: FloatArray, peaks_px: FloatArray, radius_px: float) -> list[NDArray[np.int64]]:
    return [np.flatnonzero(np.linalg.norm(peaks_px - place, axis=1) < radius_px) for place in expected_px]


def _nearest(expected_px: FloatArray, peaks_px: FloatArray, radius_px: float) -> NDArray[np.int64]:
    """Index of the peak nearest to each place, -1 where none lies within the radius or another place is nearer."""
    if not len(peaks_px):
        return np.full(len(expected_px), -1)
    distance_px = np.linalg.norm(expected_px[:, None] - peaks_px[None], axis=2)
    nearest = distance_px.argmin(axis=1)
    mutual = distance_px.argmin(axis=0)[nearest] == np.arange(len(expected_px))
    return np.where(mutual & (distance_px.min(axis=1) < radius_px), nearest, -1)
