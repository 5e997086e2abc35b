"""Which places enough views know something of: only there a droplet can be judged, and be missed."""

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.gaussian_blobs import Image
from processing.analysis.droplets.shadows.shadow_fit import ShadowFit, Transmissions
from processing.geometry import FloatArray

JUDGING_VIEWS = 3
"""So many views, or all where there are fewer, must know something of a droplet."""


MOST_BESIDE, TRUSTED_BESIDE, MOST_COVERED = 0.1, 1.1, 0.1
"""Share of the droplets that not all views know, residual over noise, and share of the views that droplets cover, from
which on together ghosts are too many: in shots of which two views do not know a band, with 0.11 to 0.16 covered,
ghosts were 13 to 29 % at 1.13 to 1.24; with 0.08 and 0.10, 2 to 3 % at 1.07 to 1.10."""


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


def is_judged(shot: Transmissions, fit: ShadowFit, positions_voxel: FloatArray) -> NDArray[np.bool_]:
    """Of which places (N, 3) enough views know something."""
    return np.asarray(knowing_views(shot, fit, positions_voxel) >= judging_views(len(shot.images)), np.bool_)


def beside_what_is_not_known(knowing: NDArray[np.int64], views: int, ratio: float, covered: float) -> tuple[str, ...]:
    """Why droplets are doubted which not all views know.

    Parameters
    ----------
    knowing : (N,) int array
        How many views know something of each droplet.
    views : int
        All of them.
    ratio : float
        Residual over noise.
    covered : float
        Share of the views that droplets cover.
    """
    share = float(np.mean(knowing < views)) if len(knowing) else 0.0
    if share <= MOST_BESIDE or ratio < TRUSTED_BESIDE or covered < MOST_COVERED:
        return ()
    reason = (
        f"not all views know {100 * share:.0f} % of the droplets, limit {100 * MOST_BESIDE:.0f} %, which cover "
        f"{100 * covered:.0f} % of the views, limit {100 * MOST_COVERED:.0f} %, and explain the images to {ratio:.2f} "
        f"times the noise, more than {TRUSTED_BESIDE:g}: fewer views make ghosts in a dense spray; take a box that all "
        "views know (--grid)"
    )
    return (reason,)
