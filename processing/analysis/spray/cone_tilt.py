"""How far the middle of a cone of directions is from an axis, also where more droplets fly to one side than to another.

Seen along the axis, a direction is ``theta`` degrees away at the azimuth ``phi``. Of a cone around the axis ``theta``
is alike at every azimuth; of one that is tilted it is ``theta_0 + a cos phi + b sin phi``, and ``(a, b)`` is the tilt.
The mean direction would be drawn to where most droplets are.
"""

import numpy as np

from processing.analysis.estimates import Figures
from processing.analysis.spray.spray_axis import SprayAxis
from processing.analysis.spray.spray_sample import SpraySample
from processing.geometry import FloatArray

FEWEST = 100
"""Droplets, to say that a cone leans."""
MOST_LEAN_DEG, SURE = 1.5, 0.99
"""Of the middle of a cone from the axis: one of 23 degrees becomes one of 26."""
WIDE = 0.75
"""Spread of directions over their distance from the axis, of a cone that is around the axis."""


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


def lean_of(sample: SpraySample, ways: FloatArray, axis: SprayAxis) -> tuple[float, float] | None:
    """By how many degrees a cone leans from an axis, and within how many with 99 %; None where it may be chance.

    Parameters
    ----------
    sample : SpraySample
        Droplets.
    ways : (N, 3) array
        Their directions, of any length.
    axis : SprayAxis
        Of which only the direction counts.
    """
    if len(sample) < FEWEST:
        return None
    addends = tilt_addends(axis, ways)
    away_deg = addends[:, 7:9].mean(axis=0)
    beside = addends[:, 7:9].std(axis=0).max() < WIDE * np.linalg.norm(away_deg)

    def leans_of(drawn: SpraySample) -> Figures:
        sums = drawn.totals(addends)
        return lambda counts: _means_deg(sums(counts)) if beside else tilts_deg(sums(counts))

    told = [one for one in sample.estimated(leans_of, signed=True, confidence=SURE) if one]
    lean_deg = float(np.linalg.norm([one.value for one in told]))
    within_deg = float(np.linalg.norm([(one.high - one.low) / 2 for one in told]))
    return (lean_deg, within_deg) if len(told) == 2 and lean_deg > max(MOST_LEAN_DEG, within_deg) else None


def _means_deg(sums: FloatArray) -> FloatArray:
    """Of directions that are all to one side of the axis: tilts are where they are."""
    return np.asarray(sums[:, 7:9] / np.maximum(sums[:, :1], 1))
