"""Corners of a checkerboard: saddle points of intensity, found by their Hessian and refined to sub-pixel accuracy."""

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from processing.calibration.target.lattice import Lattice, grow_lattice
from processing.geometry import FloatArray

Image32 = NDArray[np.float32]

SMOOTHINGS_PX = (2.0, 4.0, 1.0)
"""Scales of the derivatives, tried in turn: for most boards, for blurred and noisy ones, for tiny squares."""
COARSE_SMOOTHINGS_PX = (8.0, 16.0)
"""Likewise, where none of these shows a grid: for large squares with large blur. Of smaller ones they show a part."""
MIN_STRENGTH = 0.2
"""Saddle strength that a corner needs; an ideal sharp corner has 1."""
MIN_CONTRAST = 0.12
"""Local contrast that a corner needs, relative to the contrast of the whole image."""
MAX_AXIS_COSINE = 0.55
"""Neighbouring corners have their bright diagonals crossed; their cosine stays below this."""
MIN_NEIGHBOUR_RATIO = 0.35
"""Neighbouring corners are about equally strong, at least within this ratio."""
MIN_RELATIVE_STRENGTH = 0.03
"""Candidates weaker than this part of the strongest one are clutter."""
SEEDS = 12
"""How many of the strongest corners are tried as the start of the grid."""
SAME_GRID = 3
"""How often a grid is grown from corners that lie in it."""
REFINE_STEPS = 6
"""Steps of the refinement; three are enough for a clean corner."""
MAX_REFINE_PX = 2.5
"""A refinement that walks farther than this has found something else."""


@dataclass(frozen=True)
class Saddles:
    """Candidates for corners.

    Parameters
    ----------
    points_px : (N, 2) array
        Positions (u, v), strongest first.
    bright_axes : (N, 2) array
        Unit vectors along the bright squares that meet in the corner.
    edges : (N, 2, 2) array
        Unit vectors along the two edges that cross in it.
    strength : (N,) array
        Curvature of the saddle, in grey values per px^2; proportional to the local contrast.
    """

    points_px: FloatArray
    bright_axes: FloatArray
    edges: FloatArray
    strength: FloatArray

    def can_be_neighbours(self, a: int, b: int) -> bool:
        """Bright diagonals crossed, and about as strong: light changes slowly, clutter does not care."""
        crossed = abs(self.bright_axes[a] @ self.bright_axes[b]) < MAX_AXIS_COSINE
        return bool(crossed and MIN_NEIGHBOUR_RATIO < self.strength[a] / self.strength[b] < 1 / MIN_NEIGHBOUR_RATIO)


def find_saddles(image: Image32, smoothing_px: float) -> Saddles:
    """Candidates for checkerboard corners, to about half a pixel.

    Parameters
    ----------
    image : (rows, columns) float32 array
        Any brightness, uneven light allowed: strength is measured against the local contrast.
    smoothing_px : float
        Scale of the derivatives; corners blurred as much lose half of their strength.
    """
    smooth = _smoothed(image, smoothing_px)
    uu, vv, uv = _second_derivatives(smooth)
    saddle = np.sqrt(np.maximum(uv * uv - uu * vv, 0))
    window = cv2.getStructuringElement(cv2.MORPH_RECT, (2 * round(4 * smoothing_px) + 1,) * 2)
    contrast = cv2.dilate(smooth, window) - cv2.erode(smooth, window)
    whole_contrast = float(np.percentile(smooth, 98) - np.percentile(smooth, 2))
    strength = np.pi * smoothing_px**2 * saddle / np.maximum(contrast, 1e-6)
    peak_window = cv2.getStructuringElement(cv2.MORPH_RECT, (2 * round(1.5 * smoothing_px) + 1,) * 2)
    peaks = (saddle >= cv2.dilate(saddle, peak_window)) & (strength > MIN_STRENGTH)
    peaks &= contrast > MIN_CONTRAST * whole_contrast
    rows, columns = np.nonzero(peaks)
    order = np.argsort(-saddle[rows, columns], kind="stable")
    order = order[saddle[rows, columns][order] > MIN_RELATIVE_STRENGTH * saddle[rows, columns].max(initial=0)]
    rows, columns = rows[order], columns[order]
    axes, edges = _principal_directions(uu[rows, columns], vv[rows, columns], uv[rows, columns])
    points_px = np.column_stack([columns, rows]).astype(np.float64)
    return Saddles(points_px, axes, edges, saddle[rows, columns].astype(np.float64))


def corner_lattices(saddles: Saddles) -> Iterator[Lattice]:
    """Grids among the candidates, each grown from another strong corner; ids count from there.

    Corners of one board lead to one grid; it is grown a few times over only, in case that dust misled it.
    """
    grown = np.zeros(len(saddles.points_px), dtype=np.int64)
    for start in range(0, min(len(saddles.points_px), 3 * SEEDS), 3):
        steps_px = _steps_at(saddles, start) if grown[start] < SAME_GRID else None
        if steps_px is not None:
            lattice = grow_lattice(saddles.points_px, start, steps_px, saddles.can_be_neighbours)
            grown[lattice.indices] += 1
            yield lattice


def refine_corners(image: Image32, corners_px: FloatArray, spacing_px: float) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Sub-pixel positions (N, 2) of corners, and which of them converged nearby.

    Moves every corner to the saddle point of a quadratic surface fitted around it, until it stays (the radial
    saddle point of the paper). A slope of the light would shift the saddle; it is measured in a window as wide as
    the pattern is point-symmetric, and divided out. Smoothing came before that division: it has moved the saddle by
    ``smoothing_px**2`` times the relative slope, towards the dark, which is taken back. Smoothing and windows
    follow the spacing of the corners. On sharp boards the systematic error is 0.002 px, in even and uneven light.
    """
    smoothing_px = float(np.clip(0.045 * spacing_px, 0.8, 3.0))
    smooth = _smoothed(image, smoothing_px)
    near_px = _window(int(np.clip(0.15 * spacing_px, 2, 10)), 1.0)
    wide_px = _window(4, 0.1 * spacing_px)
    solver = _quadratic_solver(near_px)
    points_px = corners_px.astype(np.float64)
    for _ in range(REFINE_STEPS):
        slope = _relative_slope(_sample(smooth, points_px, wide_px), wide_px)
        flat = _sample(smooth, points_px, near_px) / np.maximum(1 + slope @ near_px.T, 0.1)
        step_px = np.clip(_saddle_point(flat @ solver.T), -1, 1)
        points_px += step_px
    points_px += smoothing_px**2 * slope
    settled = np.abs(step_px).max(axis=1) < 0.01
    return points_px, settled & (np.linalg.norm(points_px - corners_px, axis=1) < MAX_REFINE_PX)


def _smoothed(image: Image32, sigma_px: float) -> Image32:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px), dtype=np.float32)


def _window(half: int, pitch_px: float) -> FloatArray:
    """Offsets (M, 2), u and v, of a square window."""
    v, u = np.mgrid[-half : half + 1, -half : half + 1] * pitch_px
    return np.column_stack([u.ravel(), v.ravel()])


def _sample(image: Image32, points_px: FloatArray, offsets_px: FloatArray) -> FloatArray:
    """Grey values (N, M) at every offset from every point."""
    u, v = (points_px[:, None, axis] + offsets_px[:, axis] for axis in (0, 1))
    return np.asarray(map_coordinates(image, [v, u], order=1, mode="nearest"), dtype=np.float64)


def _relative_slope(samples: FloatArray, offsets_px: FloatArray) -> FloatArray:
    """Relative slope (N, 2) per px of the light in samples (N, M), whatever point-symmetric pattern it falls on.

    Samples opposite each other see the same pattern p, as p (1 + s x) and p (1 - s x): their difference is their sum
    times s x. A plane through all samples would lean with the pattern: a corner has no slope of its own, but light
    that falls off across one edge makes the bright squares along the other edge unequal.
    """
    difference, total = samples - samples[:, ::-1], samples + samples[:, ::-1]
    products = np.stack([offsets_px[:, i] * offsets_px[:, j] for i in (0, 1) for j in (0, 1)], axis=1)
    matrix = (total**2 @ products).reshape(-1, 2, 2) + 1e-6 * np.eye(2)
    return np.asarray(np.linalg.solve(matrix, ((total * difference) @ offsets_px)[:, :, None])[:, :, 0], np.float64)


def _quadratic_solver(offsets_px: FloatArray) -> FloatArray:
    """Least-squares solver (6, M) of c0 u^2 + c1 v^2 + c2 uv + c3 u + c4 v + c5, Gaussian weights."""
    u, v = offsets_px.T
    weights = np.exp(-2 * (u**2 + v**2) / u.max() ** 2)
    design = np.stack([u * u, v * v, u * v, u, v, np.ones_like(u)], axis=1)
    weighted = design * weights[:, None]
    return np.asarray(np.linalg.solve(weighted.T @ design, weighted.T), dtype=np.float64)


def _saddle_point(surface: FloatArray) -> FloatArray:
    """Saddle points (N, 2) of quadratic surfaces (N, 6); 1 px away where there is none, so that it never settles."""
    c0, c1, c2, c3, c4, _ = surface.T
    determinant = 4 * c0 * c1 - c2 * c2
    saddle = determinant < 0
    safe = np.where(saddle, determinant, -1.0)
    point = np.stack([c2 * c4 - 2 * c1 * c3, c2 * c3 - 2 * c0 * c4], axis=1) / safe[:, None]
    return np.where(saddle[:, None], point, 1.0)


def _second_derivatives(smooth: Image32) -> tuple[Image32, Image32, Image32]:
    second, identity = np.array([1, -2, 1], np.float32), np.array([0, 1, 0], np.float32)
    first = np.array([-0.5, 0, 0.5], np.float32)
    uu = cv2.sepFilter2D(smooth, cv2.CV_32F, second, identity)
    vv = cv2.sepFilter2D(smooth, cv2.CV_32F, identity, second)
    uv = cv2.sepFilter2D(smooth, cv2.CV_32F, first, first)
    return np.asarray(uu, np.float32), np.asarray(vv, np.float32), np.asarray(uv, np.float32)


def _principal_directions(uu: Image32, vv: Image32, uv: Image32) -> tuple[FloatArray, FloatArray]:
    """Axis of smallest curvature (along the bright squares) and the two directions without curvature (edges)."""
    hessians = np.stack([np.stack([uu, uv], -1), np.stack([uv, vv], -1)], -2).astype(np.float64)
    values, vectors = np.linalg.eigh(hessians)
    dark, bright = vectors[:, :, 1], vectors[:, :, 0]
    along_dark, along_bright = np.sqrt(-values[:, :1]), np.sqrt(values[:, 1:])
    edges = np.stack([along_dark * dark + along_bright * bright, along_dark * dark - along_bright * bright], axis=1)
    return bright, edges / np.linalg.norm(edges, axis=2, keepdims=True)


def _steps_at(saddles: Saddles, start: int) -> FloatArray | None:
    """Steps to the nearest fitting candidates along both edges of a corner, rows; None where there are none."""
    steps = []
    for edge in saddles.edges[start]:
        offsets = saddles.points_px - saddles.points_px[start]
        distance = np.linalg.norm(offsets, axis=1)
        along = np.abs(offsets @ edge)
        candidates = [
            int(index)
            for index in np.flatnonzero((distance > 0) & (along > 0.95 * distance))
            if saddles.can_be_neighbours(start, int(index))
        ]
        if not candidates:
            return None
        steps.append(offsets[candidates[np.argmin(distance[candidates])]])
    return np.array(steps)
