"""Which part of what was found is no droplet: as ``p_real`` makes expect, and counted where the truth is known."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import repeat

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.special import betaincinv, gammaincinv

from processing.analysis.droplets.size_statistics import NOTHING_MEASURED, class_numbers
from processing.analysis.estimates import CONFIDENCE, Estimate
from processing.geometry import FloatArray

RADIUS_VOXEL = 1.0
"""How far a droplet may be found from where it is."""
LEAST_TOLD = 0.5
"""Of so many of the droplets ``p_real`` must be a number, or nothing is told of how many are ghosts."""
MOST_BRIGHT = 0.01
"""Of bright particles a share above is not told: 0.8 to 3.5 times the true one was expected, most in noise"""
MODEL_SD = 0.2
"""Relative, beyond chance: of true over expected ghosts among the cases that were tried."""
MANY_OBJECTS = 0.01
"""Ligaments and the like per droplet: they may have round ends, which are told as droplets, and surely real ones."""
BESIDE_LIQUID = f"it was not tried beside more ligaments and the like than {100 * MANY_OBJECTS:g} % of the droplets"
UNTRIED = "it was not tried on droplets like the others: docs/how-sure.md lists on which it was"
_TAIL = (1 - CONFIDENCE) / 2


def told_share(
    p_real: FloatArray, sized: bool, exposures_per_shot: float = 1, untried: str = UNTRIED
) -> Estimate | str:
    """Which share of some droplets are ghosts, as ``p_real`` has it, or why it is not told.

    Parameters
    ----------
    p_real : (N,) array
        Of all droplets, of one shot or many; those of which it is not a number do not count.
    sized : bool
        Whether they are shadows, which have diameters, or bright particles.
    exposures_per_shot : float
        2 where exposures A and B, which show the same droplets, are both in the array.
    untried : str
        Why ``p_real`` is not a number, where more is known of that than where it may be so.
    """
    told = p_real[np.isfinite(p_real)]
    if not len(p_real):
        return NOTHING_MEASURED
    if not is_told(p_real):
        return f"whether droplets are real is unknown of {len(p_real) - len(told)} of {len(p_real)}; {untried}"
    share = expected_share(float(np.sum(1 - told)), len(told), exposures_per_shot)
    if not sized and share.value > MOST_BRIGHT:
        return (
            f"{100 * share.value:.1f} % are expected: of bright particles a share above {100 * MOST_BRIGHT:g} % is not "
            "told, as 0.3 to 1.3 times as many were ghosts; witnesses are twins (--twins) and unpaired_ghost_share"
        )
    return share


def is_told(p_real: FloatArray) -> bool:
    """Whether so many of the droplets (N,) have a probability that it says how many are ghosts."""
    return bool(np.count_nonzero(np.isfinite(p_real)) >= LEAST_TOLD * len(p_real))


def expected_share(ghosts: float, droplets: int, exposures_per_shot: float = 1) -> Estimate:
    """Share of the ghosts, where so many are expected among so many droplets.

    Its interval is of these droplets: what chance leaves open, and what probabilities are wrong by. So many ghosts
    follow Poisson's distribution, with a mean that is itself gamma distributed around the expected one.
    """
    expected, among = ghosts / exposures_per_shot, droplets / exposures_per_shot
    spread = 1 + MODEL_SD**2 * expected
    shape = max(expected / spread, np.finfo(np.float64).tiny)
    low, high = (spread * float(gammaincinv(shape, share)) for share in (_TAIL, 1 - _TAIL))
    most = max(expected, float(np.ceil(high)))
    return Estimate(value=expected / among, low=float(np.floor(low)) / among, high=min(1.0, most / among))


@dataclass(frozen=True)
class FoundOfClass:
    """Droplets of a class of diameters that a twin has, and what was found of them.

    Parameters
    ----------
    number : int
        Of the class, as of ``class_numbers``.
    placed, found : int
        Of so many droplets where they could be measured so many were found.
    """

    number: int
    placed: int
    found: int


@dataclass(frozen=True)
class GhostShare:
    """Ghosts among found droplets.

    Parameters
    ----------
    ghosts, found : int
        Of so many found droplets so many were ghosts.
    classes : tuple of FoundOfClass
        How many of the true ones were found, by their diameters; none where they have no diameters.
    """

    ghosts: int
    found: int
    classes: tuple[FoundOfClass, ...] = ()

    @property
    def share(self) -> float | None:
        """Ghosts over found; None where nothing was found."""
        return self.ghosts / self.found if self.found else None

    @property
    def interval(self) -> tuple[float, float] | None:
        """Where the share lies with 95 % confidence, by counting alone (Clopper and Pearson)."""
        return share_interval(self.ghosts, self.found) if self.found else None


def share_interval(chosen: int, of: int) -> tuple[float, float]:
    """Where a share lies with 95 % confidence, by counting alone (Clopper and Pearson)."""
    low = betaincinv(chosen, of - chosen + 1, _TAIL) if chosen else 0.0
    high = betaincinv(chosen + 1, of - chosen, 1 - _TAIL) if chosen < of else 1.0
    return float(low), float(high)


def pooled(shares: Iterable[GhostShare]) -> GhostShare:
    """Counts of many together."""
    counted = list(shares)
    ghosts, found = sum(share.ghosts for share in counted), sum(share.found for share in counted)
    return GhostShare(ghosts, found, pooled_classes(one for share in counted for one in share.classes))


def found_by_class(diameters_um: FloatArray, is_found: NDArray[np.bool_]) -> tuple[FoundOfClass, ...]:
    """How many of some droplets were found, by classes of their diameters (N,)."""
    numbers = class_numbers(diameters_um)
    return pooled_classes(map(FoundOfClass, numbers.tolist(), repeat(1), is_found.astype(int).tolist()))


def pooled_classes(classes: Iterable[FoundOfClass]) -> tuple[FoundOfClass, ...]:
    """Counts of many together, the smallest droplets first."""
    together: dict[int, tuple[int, int]] = {}
    for one in classes:
        placed, found = together.get(one.number, (0, 0))
        together[one.number] = placed + one.placed, found + one.found
    return tuple(FoundOfClass(number, *counts) for number, counts in sorted(together.items()))


def matches(found: FloatArray, truth: FloatArray, radius: float = RADIUS_VOXEL) -> tuple[FloatArray, FloatArray]:
    """Pairs of found and true positions one to one, closest first.

    Parameters
    ----------
    found : (N, 3) array
        Found positions.
    truth : (M, 3) array
        True ones.
    radius : float
        How far they may be apart.

    Returns
    -------
    (N,) int array
        Index of the true one, -1 for a ghost.
    (M,) int array
        Index of the found one, -1 where it was missed.
    """
    of_found, of_truth = np.full(len(found), -1), np.full(len(truth), -1)
    if not len(found) or not len(truth):
        return of_found, of_truth
    near = cKDTree(found).sparse_distance_matrix(cKDTree(truth), radius, output_type="coo_matrix")
    for pair in np.argsort(near.data, kind="stable"):
        one, other = int(near.row[pair]), int(near.col[pair])
        if of_found[one] < 0 and of_truth[other] < 0:
            of_found[one], of_truth[other] = other, one
    return of_found, of_truth
