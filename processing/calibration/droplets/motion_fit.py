"""Motions of views that explain disparities: the smallest ones of least squares, and how uncertain they are."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from processing.calibration.droplets.disparity import LocalDisparity
from processing.calibration.droplets.droplet_matching import Box
from processing.calibration.droplets.mapping_correction import correction_size, sensitivity
from processing.calibration.triangulation import linearise, unseen
from processing.geometry import FloatArray, ViewMapping

FAINTEST = 0.2
"""A common motion of the views that changes disparities by less than this share of it is left alone."""


def solve(block: FloatArray, target_px: FloatArray, faintest: float) -> FloatArray:
    """Smallest correction (P,) of least squares, without the motions that disparities hardly show."""
    matrix = block.reshape(-1, block.shape[-1])
    left, strength, motions = np.linalg.svd(matrix, full_matrices=False)
    shown = _shown(strength, target_px.size, faintest)
    amounts = (left[:, shown].T @ target_px.ravel()) / strength[shown]
    return np.asarray(motions[shown].T @ amounts, dtype=np.float64)


def largest_uncertainty_px(
    mappings: Sequence[ViewMapping], free: NDArray[np.intp], seen: Sequence[LocalDisparity], box: Box
) -> float:
    """Largest standard uncertainty, in px anywhere in the box, of the views that were free to move.

    It follows from what the sub-volumes still disagree by, and from how many there are and where.
    """
    if not len(free):
        return 0.0
    roots = np.split(
        _covariance_root(mappings, free, seen), np.cumsum([correction_size(mappings[view]) for view in free])[:-1]
    )
    points_mm = places_mm(box)
    return max(
        float(np.sqrt(((sensitivity(mappings[view], points_mm) @ root) ** 2).sum(axis=(1, 2)).max()))
        for view, root in zip(free, roots, strict=True)
    )


def _covariance_root(
    mappings: Sequence[ViewMapping], free: NDArray[np.intp], seen: Sequence[LocalDisparity]
) -> FloatArray:
    """Matrix (P, m) that times its transpose is the covariance of the corrections of all free views."""
    points_mm = np.array([disparity.point_mm for disparity in seen])
    projector = unseen(np.stack([linearise(mapping, points_mm)[1] for mapping in mappings], axis=1))
    left_px = np.stack([disparity.disparity_px.ravel() for disparity in seen])
    spans = [projector[:, :, 2 * view : 2 * view + 2] @ sensitivity(mappings[view], points_mm) for view in free]
    matrix = np.concatenate(spans, axis=2).reshape(left_px.size, -1)
    _, strength, motions = np.linalg.svd(matrix, full_matrices=False)
    shown = _shown(strength, left_px.size, FAINTEST if len(free) > 1 else 0.0)
    freedom = len(seen) * (2 * len(mappings) - 3) - int(shown.sum())
    variance = float((left_px**2).sum()) / freedom
    return np.asarray(np.sqrt(variance) * motions[shown].T / strength[shown], dtype=np.float64)


def places_mm(box: Box) -> FloatArray:
    """Corners of the box, and the middles of its edges and faces, (27, 3) with its own."""
    ranges_mm = zip(box.lower_mm, box.middle_mm, box.upper_mm, strict=True)
    return np.array(np.meshgrid(*ranges_mm)).reshape(3, -1).T


def _shown(strength: FloatArray, size: int, faintest: float) -> NDArray[np.bool_]:
    """Which motions, of such singular values, so many disparities show; ``faintest`` is relative to a common shift."""
    return np.asarray(strength > max(faintest * np.sqrt(size / 2), 1e-4 * strength[0]), dtype=np.bool_)
