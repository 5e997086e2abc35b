"""How many droplets are ghosts, as those without a partner tell: a second witness beside ``p_real``.

What is there in exposure A is there in B; a ghost lives on chance, which is another one in B. So droplets without a
partner are ghosts, or real ones that were missed in the other exposure. How often that happens, droplets of the same
size tell that are surely real.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.droplets.droplet_statistics import NO_P_REAL, NO_VOLUME, P_REAL, measured_grid
from processing.analysis.estimates import CONFIDENCE, Estimate
from processing.analysis.two_exposures.watched_droplets import SURE, Watched, watched

FEWEST_SURE, MOST_CLASSES = 50, 10
"""Of a class of sizes; all classes have as many."""
MODEL_SD, LEAST_SD = 0.2, 0.002
"""Of the share, relative and absolute, beyond chance: among the cases that were tried."""


def ghost_share_by_partners(shots: Sequence[StoredDroplets]) -> Estimate | str:
    """Which share of the droplets of some shots with velocities are ghosts, or why that is not told."""
    if any(P_REAL not in shot.columns for shot in shots):
        return NO_P_REAL
    seen = [watched(shot.columns, grid) for shot in shots if (grid := measured_grid(shot))]
    return unpaired_ghost_share(seen) if seen else NO_VOLUME


def unpaired_ghost_share(shots: Sequence[Watched]) -> Estimate | str:
    """Which share of the droplets of some double exposures are ghosts, by their partners, or why that is not told.

    Of droplets of about one size those that are surely real say which share of the real ones has a partner. So many of
    the others are real as have a partner, over that share; the rest are ghosts.
    """
    sizes, p_real, paired = (
        np.concatenate([getattr(one, name) for one in shots]) for name in ("sizes", "p_real", "paired")
    )
    is_sure = p_real > SURE
    sure = sizes[is_sure]
    if len(sure) < max(FEWEST_SURE, len(sizes) / 2):
        return (
            f"{len(sure)} of {len(sizes)} droplets that should be in both exposures are surely real (p_real above "
            f"{SURE:g}), asked for are {FEWEST_SURE} and half of all"
        )
    count = min(len(sure) // FEWEST_SURE, MOST_CLASSES)
    classes = np.digitize(sizes, np.quantile(sure, np.arange(1, count) / count))
    told = [_ghosts(is_sure[chosen], paired[chosen]) for chosen in (classes == one for one in range(count))]
    ghosts, variance = np.sum(told, axis=0) / (len(sizes), len(sizes) ** 2)
    value = max(0.0, float(ghosts))
    reach = float(ndtri((1 + CONFIDENCE) / 2) * np.sqrt(variance + (MODEL_SD * value) ** 2 + LEAST_SD**2))
    return Estimate(value=value, low=max(0.0, value - reach), high=min(1.0, value + reach))


def _ghosts(sure: NDArray[np.bool_], paired: NDArray[np.bool_]) -> tuple[float, float]:
    """How many of a class are ghosts, and the variance of that by counting."""
    known, others = np.count_nonzero(sure), np.count_nonzero(~sure)
    found_again = (np.count_nonzero(paired & sure) + 0.5) / (known + 1)
    real = np.count_nonzero(paired & ~sure) / found_again
    return others - real, real * (1 - found_again) / found_again * (1 + real / known)
