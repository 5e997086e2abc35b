"""Whether there are droplets below the smallest, or the faintest, that is told: what is missing no mean knows.

Diameters of shadows, or amplitudes of bright particles, over the least one that all are found from, have logarithms of
a mean ``m`` and a standard deviation ``s``. Of a lognormal distribution that ends far above that least one ``s / m`` is
small; of one that is cut through its middle it is 0.76 (Pearson and Lee 1908, Cohen 1949). The least one is that of a
droplet out of focus, so some smaller ones are found, too: only what is expected below and not found is missing.

How seldom bright particles just below it are found was measured: all that are found tell the likely distributions, and
these what is missing. A class of its own far below shows in no distribution: bright particles leave its light over.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import erfcx, ndtr

from processing.analysis.droplets.droplet_table import sizes_of
from processing.analysis.droplets.measured_exposure import MeasuredExposure, Rows, Seen
from processing.geometry import FloatArray

FEWEST = 15
"""Sizes that tell a distribution."""
NEAR, LEAST_NEAR = np.log(1.26), 0.06
"""Two classes of sizes above the least one; without so many of them there, a distribution ends above."""
MOST_LOST = 0.05
"""Share of the droplets that may be missing: D10 is 3 to 4 % too large then."""


@dataclass(frozen=True)
class Below:
    """What is known of droplets below the size from which on all are found.

    Parameters
    ----------
    harm : str
        What it means that they are missing; with a place for that size.
    shares, found : tuple of float
        Which part is found of those that have such a share of that size, from the least one that is told on; empty
        where nobody knows.
    """

    harm: str
    shares: tuple[float, ...] = ()
    found: tuple[float, ...] = ()


DIAMETERS = Below(
    "{:.3g} um on, and the distribution of diameters goes on below. D10 is too large and number density too small; "
    "D32 and quantiles by volume hardly notice"
)
AMPLITUDES = Below(
    "an amplitude of {:.3g} on, and the distribution of amplitudes goes on below: number density is too small, and "
    "amplitudes are those of the brighter ones. More light shows more",
    (0.5, 0.53, 0.59, 0.66, 0.75, 0.95, 1.05),
    (0.2, 0.37, 0.48, 0.55, 0.88, 0.95, 1.0),
)
"""How many of 8,000 simulated spots, 0.8 to 2 px wide, in noise of 12 to 45 %, were told to have an amplitude, over how
many had it."""
LOG_MEDIANS, SPREADS = np.linspace(-2.0, 2.5, 91), np.linspace(0.1, 1.2, 45)
"""Of lognormal distributions that are tried: medians as logarithms of shares of the limit."""
LEAST_FOUND = 1e-3
"""Of a distribution of which less is found nothing would be told."""
SURE = 1.0
"""Standard deviations. Of lognormal sprays of which 2 % are missing 0 to 1 % were told to lack more than 5."""


def judged_by_smallest(shot: MeasuredExposure[Rows, Seen], limits: Sequence[float]) -> MeasuredExposure[Rows, Seen]:
    """A shot, doubtful where droplets that its views do not show must be there, and would change its means.

    Parameters
    ----------
    shot : MeasuredExposure
        Of shadows or bright particles.
    limits : sequence of float
        From which diameter in um, or amplitude, on each view shows droplets.
    """
    below = DIAMETERS if shot.droplets.sized else AMPLITUDES
    reason = cut_off(sizes_of(shot.droplets.columns()), complete_from(limits), below)
    return shot.doubted((reason,)) if reason else shot


def judged_by_fainter(shot: MeasuredExposure[Rows, Seen], fainter: int) -> MeasuredExposure[Rows, Seen]:
    """A shot, doubtful where, beside its droplets, so many spots are fainter than what is told, but for chance."""
    together = len(shot.droplets) + fainter
    if fainter - SURE * np.sqrt(fainter) <= MOST_LOST * together:
        return shot
    why = (
        f"beside those that are told all views see {fainter} spots which are fainter than a tenth of a typical one. "
        "Number density is too small; or are they copies, by a second flash?"
    )
    return shot.doubted((_missing(fainter / together, why),))


def complete_from(limits: Sequence[float]) -> float:
    """Size from which on droplets are found, by that from which on each view shows them: half of the views do."""
    return float(np.median(limits)) if len(limits) else 0.0


def cut_off(sizes: FloatArray, limit: float | FloatArray, below: Below = DIAMETERS) -> str:
    """Why (N,) diameters or amplitudes are a part of all; empty where they end above the limit, or are few.

    Parameters
    ----------
    sizes : (N,) array
        Of the droplets that were found.
    limit : float or (N,) array
        From where on they are found, 0 where nobody knows.
    below : Below
        What is known of those below the limit.
    """
    limits = np.broadcast_to(limit, np.shape(sizes))
    known = limits > 0
    shares = sizes[known] / limits[known]
    least, likely = _lost_to_noise(np.log(shares), below) if below.shares else _lost_shares(np.log(shares))
    if least <= MOST_LOST:
        return ""
    return _missing(likely, f"all are found from {below.harm.format(np.median(limits[known]))}")


def _missing(share: float, why: str) -> str:
    return f"about {100 * share:.0f} % of the droplets, limit {100 * MOST_LOST:.0f} %, are missing: {why}"


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


def _lost_to_noise(logs: FloatArray, below: Below) -> tuple[float, float]:
    """The same where it is known which part is found: of lognormal distributions that make what is found likely."""
    told = logs[logs >= np.log(below.shares[0])]
    if len(told) < FEWEST or np.mean(told < NEAR) < LEAST_NEAR:
        return 0.0, 0.0
    squares = (told.mean() - LOG_MEDIANS[:, None]) ** 2 + told.var()
    found = _found_shares(below)
    likelihoods = -len(told) * (np.log(SPREADS) + 0.5 * squares / SPREADS**2 + np.log(found))
    likely = likelihoods >= likelihoods.max() - 0.5 * SURE**2
    return 1 - float(found[likely].max()), 1 - float(found.ravel()[likelihoods.argmax()])


@lru_cache(maxsize=1)
def _found_shares(below: Below) -> FloatArray:
    """Which part is found of lognormal distributions, by their medians over the limit, and their spreads (M, S)."""
    logs, step = np.linspace(np.log(below.shares[0]), LOG_MEDIANS[-1] + 4 * SPREADS[-1], 400, retstep=True)
    found = np.interp(np.exp(logs), below.shares, below.found)
    scores = (logs - LOG_MEDIANS[:, None, None]) / SPREADS[:, None]
    density = np.exp(-0.5 * scores**2) / (np.sqrt(2 * np.pi) * SPREADS[:, None])
    return np.asarray(np.clip(np.sum(density * found, axis=2) * step, LEAST_FOUND, 1.0))


@lru_cache(maxsize=1)
def _cut_shares() -> tuple[FloatArray, FloatArray]:
    """Standard deviation over mean of a normal distribution's part above 0, and the share of it that is below."""
    starts = np.linspace(-8, 4, 481)
    hazards = np.sqrt(2 / np.pi) / erfcx(starts / np.sqrt(2))
    spreads = np.sqrt(1 - hazards * (hazards - starts)) / (hazards - starts)
    return spreads, np.asarray(ndtr(starts))
