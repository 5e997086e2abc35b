"""Which places enough views know something of: only there a droplet can be judged, and be missed."""

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.droplet_search import DropletSearch
from processing.analysis.droplets.gaussian_blobs import Image
from processing.analysis.droplets.shadows.shadow_fit import ShadowFit, Transmissions
from processing.geometry import FloatArray

JUDGING_VIEWS = 3
"""So many views, or all where there are fewer, must know something of a droplet."""


def judging_views(views: int) -> int:
    """How many of so many views must judge a droplet."""
    return min(JUDGING_VIEWS, views)


def knowing_views(shot: Transmissions, fit: ShadowFit, positions_voxel: FloatArray) -> NDArray[np.int64]:
    """How many views (N,) know something of places (N, 3), x, y, z in voxels of what is searched."""
    seen_px = shot.lattice.seen_px(positions_voxel) + fit.optics.shifts_px[:, None]
    trusts = shot.masked(fit.masks).trust
    return np.asarray(np.sum([_known(*view) for view in zip(trusts, seen_px, strict=True)], axis=0), dtype=np.int64)


def _known(trust: Image, seen_px: FloatArray) -> NDArray[np.bool_]:
    columns, rows = np.rint(seen_px).astype(int).T
    inside = (columns >= 0) & (rows >= 0) & (columns < trust.shape[1]) & (rows < trust.shape[0])
    known = np.zeros(len(seen_px), bool)
    known[inside] = trust[rows[inside], columns[inside]] > 0
    return known


def unjudged_share(shot: Transmissions, fit: ShadowFit, search: DropletSearch) -> float:
    """Share of the grid of which too few views know something."""
    return float(np.mean(knowing_views(shot, fit, search.places()) < judging_views(len(shot.images))))
