"""Droplets found and ghosts in a reconstruction, at every threshold at once; and two ways to choose the threshold."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from processing.analysis.quality import Volume, local_maxima
from processing.geometry import FloatArray

FAINTEST_PEAK = 1e-5
"""Peaks below this share of the highest one are never droplets."""
RADIUS_VOXEL = 2.0
"""How far a peak may lie from its droplet."""


@dataclass(frozen=True)
class DetectionRates:
    """How many droplets a reconstruction shows.

    Parameters
    ----------
    found : float
        Share of true droplets that have a peak.
    ghosts : float
        Share of peaks that belong to no true droplet.
    """

    found: float
    ghosts: float


@dataclass(frozen=True, eq=False)
class DetectionCurve:
    """What counts as a droplet when the threshold falls from peak to peak.

    Parameters
    ----------
    heights : (N,) array
        Heights of all peaks, highest first.
    found : (N,) array
        Share of true droplets that have a peak of their own among the first peaks.
    ghosts : (N,) array
        Share of the first peaks that belong to no true droplet.
    """

    heights: FloatArray
    found: FloatArray
    ghosts: FloatArray

    def rates(self, threshold: float) -> DetectionRates:
        """Found and ghosts among peaks not lower than a threshold."""
        counted = int(np.searchsorted(-self.heights, -threshold, side="right"))
        if counted == 0:
            return DetectionRates(found=0.0, ghosts=0.0)
        return DetectionRates(float(self.found[counted - 1]), float(self.ghosts[counted - 1]))


def detection_curve(centres_voxel: FloatArray, volume: Volume, radius_voxel: float = RADIUS_VOXEL) -> DetectionCurve:
    """Compare all peaks of a reconstruction with the truth.

    A peak counts for its nearest droplet only, so that two droplets which merged count as one found.

    Parameters
    ----------
    centres_voxel : (N, 3) array
        True positions as voxel indices (z, y, x), N > 0.
    volume : (z, y, x) array
        Reconstruction.
    radius_voxel : float
        How far a peak may lie from its droplet.
    """
    peaks = local_maxima(volume, FAINTEST_PEAK * float(volume.max()))
    heights = volume[tuple(peaks.T)].astype(np.float64)
    order = np.argsort(-heights, kind="stable")
    distance_voxel, droplet = map(np.asarray, cKDTree(centres_voxel).query(peaks[order].reshape(-1, 3)))
    real = distance_voxel <= radius_voxel
    ghosts = np.cumsum(~real) / np.arange(1, len(order) + 1)
    found = np.cumsum(_first_of_each(droplet, real)) / len(centres_voxel)
    return DetectionCurve(heights[order], found, ghosts)


def _first_of_each(droplet: NDArray[np.intp], real: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mark the highest real peak of every droplet."""
    first = np.zeros(len(droplet), dtype=np.bool_)
    candidates = np.flatnonzero(real)
    first[candidates[np.unique(droplet[candidates], return_index=True)[1]]] = True
    return first


def best_threshold(curve: DetectionCurve) -> float:
    """Threshold with the least missed droplets plus ghosts. Needs the truth: a bound, not a method."""
    if not len(curve.heights):
        return 0.0
    return float(curve.heights[np.argmin(curve.ghosts - curve.found)])


def half_median_threshold(curve: DetectionCurve) -> float:
    """Half the median height of the peaks above it; looks at heights alone, so that a lab can use it.

    Found from the highest hundredth of the peaks downwards. It holds where droplets are about equally bright and
    most ghosts fainter than half a droplet; where ghosts outnumber droplets it slides down among them.
    """
    heights = curve.heights
    if not len(heights):
        return 0.0
    counted, before = max(1, len(heights) // 100), 0
    # fewer peaks have a higher median: the number only grows, or only falls, and so it settles
    while counted != before:
        threshold = 0.5 * float(np.median(heights[:counted]))
        counted, before = int(np.searchsorted(-heights, -threshold, side="right")), counted
    return threshold
