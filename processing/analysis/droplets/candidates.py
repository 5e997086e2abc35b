"""Where droplets may be that are not in the fit yet: peaks of MINLOS of the residual images."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from processing.analysis.droplets.droplet_search import Window
from processing.analysis.droplets.gaussian_blobs import Image
from processing.geometry import FloatArray
from processing.kernels import _native
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.planning.plan import Plan

SLAB_ROWS = 32
EMPTY = 0.3
"""Of the threshold: pixels below have no say, so that the kernels need not look there."""


def candidates(
    plan: Plan,
    residuals: Sequence[Image],
    gains: FloatArray,
    threshold: float,
    threads: int,
    windows: Sequence[Window] = (),
) -> FloatArray:
    """Peaks (N, 4): x, y, z in voxels of the plan and height, where all views have an amplitude of ``threshold`` left.

    Parameters
    ----------
    plan : Plan
        Geometry of views and grid.
    residuals : sequence of (rows, columns) float32 arrays
        What the images hold beyond the droplets that are known.
    gains : (K,) array
        Height of a droplet of amplitude 1 in every view.
    threshold : float
        Above 0.
    threads : int
        The result does not depend on it.
    windows : sequence of (rows, columns) slices
        What the residuals are of each image, beyond which nothing is left; empty: all of it.
    """
    lit = [_lit(*view, threshold) for view in zip(residuals, gains, strict=True)]
    whole = [_placed(*one) for one in zip(lit, windows, _shapes(plan), strict=True)] if windows else lit
    seen = plan.bind(plan.resample(whole, threads))
    nz, ny, nx = plan.grid.shape
    found = []
    for first in range(0, ny, SLAB_ROWS):
        end = min(first + SLAB_ROWS, ny)
        above, below = max(first - 1, 0), min(end + 1, ny)
        slab = np.empty((nz, below - above, nx), np.float32)
        _native.line_of_sight(seen, ReconstructionMethod.MINLOS, slab, threads, above, ny)
        peaks = _native.find_peaks(slab, first - above, end - above, threshold)
        found.append(peaks + np.array([0, above, 0, 0]))
    return np.concatenate(found)


def _lit(residual: Image, gain: float, threshold: float) -> Image:
    amplitudes = residual * np.float32(1 / gain)
    return np.where(amplitudes > EMPTY * threshold, amplitudes, np.float32(0))


def _shapes(plan: Plan) -> list[tuple[int, int]]:
    return [(view.image_size_px[1], view.image_size_px[0]) for view in plan.views]


def _placed(part: Image, window: Window, shape: tuple[int, int]) -> Image:
    image = np.zeros(shape, np.float32)
    image[window] = part
    return image


def foremost(peaks: FloatArray, apart: float) -> FloatArray:
    """The peaks (M, 4), of (N, 4) with heights in the last column, that have no higher one nearby; highest first."""
    ordered = peaks[np.argsort(-peaks[:, 3], kind="stable")]
    kept = np.ones(len(ordered), bool)
    for one, other in close_pairs(ordered[:, :3], apart):
        if kept[one]:
            kept[other] = False
    return ordered[kept]


def close_pairs(positions: FloatArray, apart: float) -> list[list[int]]:
    """Pairs of positions (N, 3) that are closer, in the order of the first and then of the second."""
    if not len(positions):
        return []
    pairs = cKDTree(positions).query_pairs(apart, output_type="ndarray")
    return list(pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))].tolist())
