"""Dots of a calibration target: bright or dark blobs, their centroids, and the one that carries a marker."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from processing.calibration.target.lattice import Lattice, grow_lattice
from processing.geometry import FloatArray

Image32 = NDArray[np.float32]

BACKGROUND_PX = 25.0
"""Scale above which brightness counts as uneven light, not as a dot."""
DETECTION_LEVEL = 0.25
"""A dot reaches this part of the brightest signal."""
CENTROID_FLOOR = 0.08
"""Part of a dot's peak that its centroid ignores: noise and the feet of neighbours."""
AREA_RANGE = (0.25, 4.0)
"""Area of a dot relative to the median one; dust and reflections lie outside."""
SEEDS = 9
"""How many dots are tried as the start of the grid."""


def dot_signal(image: Image32) -> Image32:
    """Image without uneven light, dots positive whether they are bright or dark."""
    signal = image - cv2.GaussianBlur(image, (0, 0), BACKGROUND_PX)
    signal -= np.float32(np.median(signal))
    dark, bright = np.percentile(signal, [0.05, 99.95])
    return np.asarray(signal if bright > -dark else -signal, dtype=np.float32)


def find_dots(image: Image32, signal: Image32) -> FloatArray:
    """Centroids (N, 2) of the dots of an image, which its ``dot_signal`` shows.

    The signal tells where dots are, but leans at the outermost of them, where the mean around has dots on one side
    only; their centroids are those of the image.
    """
    level = DETECTION_LEVEL * float(np.percentile(signal, 99.95))
    if level <= 0:
        return np.empty((0, 2))
    _, _, stats, _ = cv2.connectedComponentsWithStats((signal > level).astype(np.uint8))
    boxes, areas = _without_rings(np.asarray(stats[1:], dtype=np.int32))
    median_area = np.median(areas[areas >= 2]) if np.any(areas >= 2) else 0
    usual = (areas >= max(2, AREA_RANGE[0] * median_area)) & (areas <= AREA_RANGE[1] * median_area)
    centroids = [_centroid(image, box) for box in boxes[usual]]
    return np.array([centre for centre in centroids if centre is not None]).reshape(-1, 2)


def _without_rings(found: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Boxes (N, 4) and areas (N,) of what surrounds the middle of nothing else: rings are markers, no dots."""
    boxes, areas = found[:, :4], found[:, 4]
    middles, sizes = boxes[:, :2] + boxes[:, 2:] / 2, boxes[:, 2:]
    around = (np.abs(middles[None] - middles[:, None]) < sizes[:, None] / 4).all(axis=2)
    larger = sizes.prod(axis=1)[:, None] > sizes.prod(axis=1)
    dots = ~(around & larger & (areas >= 2)).any(axis=1)
    return boxes[dots], areas[dots]


def assign_dots(points_px: FloatArray) -> Lattice:
    """The largest grid among the dots; ids count from wherever it was started."""
    best = Lattice(np.empty((0, 2), np.int64), np.empty(0, np.int64))
    if len(points_px) < 3:
        return best
    distance = np.linalg.norm(points_px - np.median(points_px, axis=0), axis=1)
    for start in np.argsort(distance, kind="stable")[:SEEDS]:
        steps_px = _steps_at(points_px, int(start))
        if steps_px is not None:
            best = max(best, grow_lattice(points_px, int(start), steps_px), key=len)
        if len(best) * 5 > len(points_px) * 4:
            break
    return best


def marked_dot(signal: Image32, points_px: FloatArray) -> int | None:
    """Index of the one dot that a marker (square, ring) surrounds; None where there is no such dot."""
    distances_px = np.asarray(KDTree(points_px).query(points_px, k=2)[0])
    half_px = int(0.42 * np.median(distances_px[:, 1]))
    patches = [_patch(signal, point, half_px) for point in points_px]
    hole_px = min(_radius_px(patches) + 1, half_px // 2)
    quadrants = np.array([_surroundings(patch, hole_px) for patch in patches])
    light = quadrants.mean(axis=1) - np.median(quadrants.mean(axis=1))
    marked = int(np.argmax(light))
    others = np.delete(light, marked)
    spread = 1.4826 * float(np.median(np.abs(others)))
    stands_out = light[marked] > max(10 * spread, 3 * float(others.max()), 1e-4 * float(signal.max()))
    surrounded = quadrants[marked].min() > 0.3 * quadrants[marked].mean()
    return marked if stands_out and surrounded else None


def _centroid(image: Image32, box: NDArray[np.int32]) -> tuple[float, float] | None:
    left, top, width, height = (int(value) for value in box)
    margin = 2 + max(width, height) // 3
    rows, columns = slice(top - margin, top + height + margin), slice(left - margin, left + width + margin)
    if min(rows.start, columns.start) < 0 or rows.stop > image.shape[0] or columns.stop > image.shape[1]:
        return None
    contrast = _contrast(image[rows, columns].astype(np.float64))
    weights = np.maximum(contrast - CENTROID_FLOOR * contrast.max(), 0)
    v, u = np.indices(weights.shape)
    total = max(weights.sum(), 1e-9)
    return float((u * weights).sum() / total) + columns.start, float((v * weights).sum() / total) + rows.start


def _contrast(patch: FloatArray) -> FloatArray:
    """Patch without the ground around its dot, positive; a dark dot as the part of the light that it takes away.

    A dot takes away more where there is more light, which would draw its centroid there, by d^2 / 16 times the
    relative slope of the light. Bright dots are still drawn so: their dark ground does not tell of the light.
    """
    ground = _ground(patch)
    if patch.sum() > ground.sum():
        return patch - ground
    return 1 - patch / np.maximum(ground, 1e-6)


def _ground(patch: FloatArray) -> FloatArray:
    """Plane through the medians of the four edges: neighbours and markers may cover less than half of an edge."""
    top, bottom, left, right = (np.median(edge) for edge in (patch[0], patch[-1], patch[:, 0], patch[:, -1]))
    v, u = (np.linspace(-0.5, 0.5, count) for count in patch.shape)
    mean = (top + bottom + left + right) / 4
    return np.asarray(mean + (bottom - top) * v[:, None] + (right - left) * u, dtype=np.float64)


def _patch(signal: Image32, point_px: FloatArray, half_px: int) -> Image32 | None:
    """Signal around a dot; None at the image border."""
    column, row = (round(float(value)) for value in point_px)
    if min(column, row) < half_px or row + half_px >= signal.shape[0] or column + half_px >= signal.shape[1]:
        return None
    return signal[row - half_px : row + half_px + 1, column - half_px : column + half_px + 1]


def _radius_px(patches: Sequence[Image32 | None]) -> int:
    """Of most dots."""
    areas = [
        np.count_nonzero(patch > patch[len(patch) // 2, len(patch) // 2] / 2) for patch in patches if patch is not None
    ]
    return round(float(np.sqrt(np.median(areas) / np.pi))) if areas else 0


def _surroundings(patch: Image32 | None, hole_px: int) -> FloatArray:
    """Mean signal in the four quadrants around a dot, the dot itself left out; zeros at the image border."""
    if patch is None:
        return np.zeros(4)
    middle, patch = len(patch) // 2, patch.copy()
    patch[middle - hole_px : middle + hole_px + 1, middle - hole_px : middle + hole_px + 1] = 0
    halves = np.array_split(patch, 2)
    return np.array([part.mean() for half in halves for part in np.array_split(half, 2, axis=1)], dtype=np.float64)


def _steps_at(points_px: FloatArray, start: int) -> FloatArray | None:
    """Steps (2, 2) to the nearest dot and to the nearest in another direction; None where there are none."""
    offsets = np.delete(points_px, start, axis=0) - points_px[start]
    distance = np.linalg.norm(offsets, axis=1)
    first = offsets[np.argmin(distance)]
    sine = np.abs(offsets[:, 0] * first[1] - offsets[:, 1] * first[0]) / (distance * np.linalg.norm(first))
    aside = np.flatnonzero(sine > 0.7)
    if not len(aside):
        return None
    return np.array([first, offsets[aside[np.argmin(distance[aside])]]])
