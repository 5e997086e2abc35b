"""Whether the distribution of diameters goes on below the smallest droplet that shows: what is missing no mean knows.

Diameters over the least one that all are found from, as logarithms, have a mean ``m`` and a standard deviation ``s``.
Of a lognormal distribution that ends far above that least one ``s / m`` is small; of one that is cut through its middle
it is 0.76 (Pearson and Lee 1908, Cohen 1949). The least one is that of a droplet out of focus, so some smaller ones are
found, too: only what is expected below and not found is missing.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from scipy.special import erfcx, ndtr

from processing.analysis.droplets.droplet_table import SizedDroplets
from processing.analysis.droplets.measured_exposure import MeasuredExposure, Seen
from processing.geometry import FloatArray

FEWEST = 15
"""Diameters that tell a distribution."""
NEAR, LEAST_NEAR = np.log(1.26), 0.06
"""Two classes of diameters above the least one; without so many of them there, a distribution ends above."""
MOST_LOST = 0.05
"""Share of the droplets that may be missing: D10 is 3 to 4 % too large then."""
SURE = 1.0
"""Standard deviations. Of lognormal sprays of which 2 % are missing 0 to 1 % were told to lack more than 5."""


def judged_by_smallest(
    shot: MeasuredExposure[SizedDroplets, Seen], limits_um: Sequence[float]
) -> MeasuredExposure[SizedDroplets, Seen]:
    """A shot, doubtful where smaller droplets than its views show must be there, and would change its means."""
    reason = cut_off(shot.droplets.diameters_um, complete_from_um(limits_um))
    return shot.doubted((reason,)) if reason else shot


def complete_from_um(limits_um: Sequence[float]) -> float:
    """Diameter from which on droplets are found, by that from which on each view shows them: half of the views do."""
    return float(np.median(limits_um)) if len(limits_um) else 0.0


def cut_off(diameters_um: FloatArray, limit_um: float | FloatArray) -> str:
    """Why (N,) diameters are a part of a distribution; empty where it ends above the limit, or N is small.

    Parameters
    ----------
    diameters_um : (N,) array
        Of the droplets that were found.
    limit_um : float or (N,) array
        From where on they are found, 0 where nobody knows.
    """
    limits_um = np.broadcast_to(limit_um, np.shape(diameters_um))
    known = limits_um > 0
    least, likely = _lost_shares(np.log(diameters_um[known] / limits_um[known]))
    if least <= MOST_LOST:
        return ""
    return (
        f"about {100 * likely:.0f} % of the droplets, limit {100 * MOST_LOST:.0f} %, are missing: all are found from "
        f"{np.median(limits_um[known]):.3g} um on, and the distribution of diameters goes on below. "
        "D10 is too large and number density too small; D32 and quantiles by volume hardly notice"
    )


def _lost_shares(logs: FloatArray) -> tuple[float, float]:
    """Share of the droplets that is below 0 and not found: the least, which is sure, and the likeliest."""
    above = logs[logs >= 0]
    if len(above) < FEWEST or np.mean(above < NEAR) < LEAST_NEAR:
        return 0.0, 0.0
    spread = float(above.std() / above.mean())
    error = spread * np.sqrt((0.5 + spread**2) / len(above))
    below = np.interp([spread - SURE * error, spread], *_cut_shares())
    expected = len(above) * below / (1 - below)
    found = len(logs) - len(above)
    least, likely = (np.maximum(expected - found, 0) / (len(above) + np.maximum(expected, found))).tolist()
    return least, likely


@lru_cache(maxsize=1)
def _cut_shares() -> tuple[FloatArray, FloatArray]:
    """Standard deviation over mean of a normal distribution's part above 0, and the share of it that is below."""
    starts = np.linspace(-8, 4, 481)
    hazards = np.sqrt(2 / np.pi) / erfcx(starts / np.sqrt(2))
    spreads = np.sqrt(1 - hazards * (hazards - starts)) / (hazards - starts)
    return spreads, np.asarray(ndtr(starts))
