"""How far the middle of a cone of directions is from an axis, also where more droplets fly to one side than to another.

Seen along the axis, a direction is ``theta`` degrees away at the azimuth ``phi``. Of a cone around the axis ``theta``
is alike at every azimuth; of one that is tilted it is ``theta_0 + a cos phi + b sin phi``, and ``(a, b)`` is the tilt.
The mean direction would be drawn to where most droplets are.
"""

import numpy as np

from processing.analysis.spray.spray_axis import SprayAxis
from processing.geometry import FloatArray


def tilt_addends(axis: SprayAxis, ways: FloatArray) -> FloatArray:
    """What directions, (N, 3) of any length, add to the equations of the tilt: (N, 9)."""
    along, first, second = axis.frame @ ways.T
    theta_deg, phi = np.degrees(np.arctan2(np.hypot(first, second), along)), np.arctan2(second, first)
    c, s = np.cos(phi), np.sin(phi)
    return np.column_stack([np.ones(len(c)), c, s, c * c, c * s, s * s, theta_deg, theta_deg * c, theta_deg * s])


def tilts_deg(sums: FloatArray) -> FloatArray:
    """Tilts towards the two directions across the axis, (rows, 2), of sums of addends, (rows, 9)."""
    known = np.isfinite(sums).all(axis=1)
    n, c, s, cc, cs, ss = sums[known, :6].T
    matrices = np.moveaxis(np.array([[n, c, s], [c, cc, cs], [s, cs, ss]]), 2, 0)
    found = np.full((len(sums), 2), np.nan)
    found[known] = np.einsum("rij,rj->ri", np.linalg.pinv(matrices, hermitian=True), sums[known, 6:])[:, 1:]
    return found
