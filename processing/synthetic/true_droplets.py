"""True droplets of a firing at any time: what a measurement should have found. Rows are the same at all times."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from processing.synthetic.spray import LiquidKind, Spray
from processing.synthetic.stamping import FloatArray
from processing.synthetic.truth_file import FiredSpray


@dataclass(frozen=True, eq=False)
class TrueDroplets:
    """Droplets at one instant; film and ligaments are left out.

    Parameters
    ----------
    positions_mm : (N, 3) array
        Centres (x, y, z), outside of any grid too.
    diameters_mm : (N,) array
        Diameters.
    velocities_mm_per_s : (N, 3) array
        Velocities.
    free : (N,) bool array
        Touches no other droplet, ligament or film at this instant: those alone can be told by their outline.
    """

    positions_mm: FloatArray
    diameters_mm: FloatArray
    velocities_mm_per_s: FloatArray
    free: NDArray[np.bool_]


def true_droplets(fired: FiredSpray, time_ns: float) -> TrueDroplets:
    """Droplets of a firing at a time after its trigger; row n is the same droplet at all times.

    Exposure A of a shot is at ``fired.time_ns``, B the separation of the pulses later.
    """
    spray = fired.spray.advanced((time_ns - fired.time_ns) * 1e-9)
    droplets = spray.of_kind(LiquidKind.DROPLET)
    return TrueDroplets(
        droplets.positions_mm, droplets.diameters_mm, droplets.velocities_mm_per_s, _free(spray, droplets)
    )


def _free(spray: Spray, droplets: Spray) -> NDArray[np.bool_]:
    """Which droplets overlap with no ball but themselves, (N,)."""
    if not len(droplets):
        return np.zeros(0, np.bool_)
    reach_mm = 0.5 * (droplets.diameters_mm.max() + spray.diameters_mm.max())
    near = cKDTree(droplets.positions_mm).sparse_distance_matrix(
        cKDTree(spray.positions_mm), reach_mm, output_type="coo_matrix"
    )
    touching = near.data < 0.5 * (droplets.diameters_mm[near.row] + spray.diameters_mm[near.col])
    return np.bincount(near.row[touching], minlength=len(droplets)) <= 1
