"""Droplets of double exposures that should be in the grid in both: which of them have a partner says something."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.droplet_file import FRAME
from processing.analysis.droplets.droplet_statistics import P_REAL
from processing.analysis.droplets.droplet_table import Columns, sizes_of
from processing.geometry import FloatArray
from processing.volume import VoxelGrid

SURE = 0.95
"""Droplets that are more probably real tell how often real ones have a partner."""
PARTNER = "partner"


@dataclass(frozen=True, eq=False)
class Watched:
    """Droplets that should be in the grid in the other exposure, too.

    Parameters
    ----------
    rows : (N,) int array
        Of the table.
    sizes : (N,) array
        Diameters, or amplitudes.
    p_real : (N,) array
        Probability of being real.
    paired : (N,) bool array
        Whether they have a partner.
    """

    rows: NDArray[np.intp]
    sizes: FloatArray
    p_real: FloatArray
    paired: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.sizes)


def watched(columns: Columns, grid: VoxelGrid) -> Watched:
    """Those of a shot: droplets that stay in the grid, whichever of the displacements of all pairs were theirs.

    Parameters
    ----------
    columns : mapping of name to (N,) array
        As files have them, exposures A and B.
    grid : VoxelGrid
        In which they were measured.
    """
    points_mm = np.column_stack([np.asarray(columns[name], np.float64) for name in ("x_mm", "y_mm", "z_mm")])
    first, partner = columns[FRAME].astype("U1") == "a", np.asarray(columns[PARTNER], np.intp)
    stays = staying(points_mm, first, partner, grid)
    p_real = columns[P_REAL].astype(np.float64)
    return Watched(np.flatnonzero(stays), sizes_of(columns)[stays], p_real[stays], partner[stays] >= 0)


def staying(
    points_mm: FloatArray, first: NDArray[np.bool_], partner: NDArray[np.intp], grid: VoxelGrid
) -> NDArray[np.bool_]:
    """Which droplets of both exposures stay in the grid, whichever of the displacements of all pairs were theirs.

    Parameters
    ----------
    points_mm : (N, 3) array
        Of A, and of B.
    first : (N,) bool array
        Which ones are of A.
    partner : (N,) int array
        Row of the partner; -1 of droplets that have none.
    grid : VoxelGrid
        In which they were measured.
    """
    own = np.flatnonzero(first & (partner >= 0))
    if not len(own):
        return np.zeros(len(first), np.bool_)
    moved_mm, sign = points_mm[partner[own]] - points_mm[own], np.where(first, 1, -1)[:, None]
    ends = [grid.to_index(points_mm + sign * end)[:, ::-1] for end in (moved_mm.min(axis=0), moved_mm.max(axis=0))]
    inside = [(end >= -0.5) & (end < np.array(grid.shape[::-1]) - 0.5) for end in ends]
    return np.asarray(np.all(inside, axis=(0, 2)), np.bool_)
