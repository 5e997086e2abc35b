"""Which droplet of exposure B is which one of A: probabilities, with *no partner* as one of the answers.

The motion around a droplet says where its partner should be; how far partners scatter around that place, how much they
differ in size, and how many droplets have a partner at all is estimated from the droplets themselves, round by round
(expectation, maximisation). A candidate is weighed against a stranger that happens to be there, by the density of
droplets around it, and against all other candidates of both.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from processing.analysis.velocity.common_motion import FEWEST, Indices, common_motion
from processing.analysis.velocity.local_motion import KnownMotion, predicted
from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.geometry import FloatArray

CANDIDATES_VOXEL = 8.0
"""So far from where it should be a partner is looked for."""
ROUNDS = 8
BELIEVED = 0.5
"""More likely than all else together."""
FIRST_SCATTER_VOXEL, LEAST_SCATTER_VOXEL = 1.5, 0.02
FIRST_UNLIKENESS, LEAST_UNLIKENESS = 0.5, 0.02
FIRST_SHARE, SHARES = 0.5, (0.01, 0.98)
"""Of the droplets that have a partner: at first, and how sure of it one may be."""
DENSITY_NEIGHBOURS = 8


@dataclass(frozen=True)
class Spread:
    """How partners differ.

    Parameters
    ----------
    scatter : float
        Standard deviation of each component of the displacement around that of the neighbours, voxel, beyond what the
        covariances of both places explain.
    unlikeness : float
        Standard deviation of the logarithm of the ratio of their sizes.
    share : float
        Of the droplets that have a partner.
    """

    scatter: float = FIRST_SCATTER_VOXEL
    unlikeness: float = FIRST_UNLIKENESS
    share: float = FIRST_SHARE


@dataclass(frozen=True, eq=False)
class Partners:
    """Partners of the droplets of one exposure in the other one.

    Parameters
    ----------
    partner : (N,) int array
        Index of the most likely one if it is more likely than all else together, else -1.
    p_pair : (N,) array
        Probability of the most likely one, believed or not; 0 where there is no candidate.
    p_runner_up : (N,) array
        Probability of the second.
    """

    partner: Indices
    p_pair: FloatArray
    p_runner_up: FloatArray

    @classmethod
    def none(cls, count: int) -> "Partners":
        """Of droplets without partners."""
        return cls(np.full(count, -1, np.intp), np.zeros(count), np.zeros(count))


@dataclass(frozen=True, eq=False)
class Pairing:
    """Partners of all droplets of two exposures.

    Parameters
    ----------
    first, second : Partners
        Of the droplets of A, and of B.
    shifts : (N, 3) array | None
        Where droplets of A should have gone by their neighbours, in voxels; None where no motion is common to any.
    spread : Spread
        How partners differ.
    """

    first: Partners
    second: Partners
    shifts: FloatArray | None
    spread: Spread

    def disbelieved(self) -> "Pairing":
        """The same without partners; probabilities stay."""
        nobody = [replace(one, partner=np.full_like(one.partner, -1)) for one in (self.first, self.second)]
        return replace(self, first=nobody[0], second=nobody[1])

    @property
    def pairs(self) -> tuple[Indices, Indices]:
        """Indices of A and of B."""
        (own,) = np.nonzero(self.first.partner >= 0)
        return own, self.first.partner[own]


@dataclass(frozen=True, eq=False)
class _Candidates:
    """Pairs that may be: indices of A and B, and how far B is from where A should have gone."""

    own: Indices
    other: Indices
    misses: FloatArray


def pair(first: MovingDroplets, second: MovingDroplets) -> Pairing:
    """Pair the droplets of A with those of B; no displacement need be known, it may be as large as 25 voxels.

    Parameters
    ----------
    first, second : MovingDroplets
        Of A and B. Neither their order nor the axes matter.
    """
    common, spread = common_motion(first.places, second.places), Spread()
    known = KnownMotion(common.places, common.shifts, np.ones(len(common)), np.full(len(common), -1))
    found, shifts = _nobody(first, second), None
    for _ in range(ROUNDS if len(common) else 0):
        shifts = predicted(known, first.places)
        candidates = _candidates(first, second, shifts)
        odds = _odds(candidates, first, second, spread)
        likely = _likely(candidates, odds, len(first), len(second))
        spread = _renewed(candidates, likely, first, second)
        found = _partners(candidates, likely, len(first), len(second))
        (own,) = np.nonzero(found[0].partner >= 0)
        if len(own) < FEWEST:
            return Pairing(*_nobody(first, second), None, spread)
        other = found[0].partner[own]
        known = KnownMotion(first.places[own], second.places[other] - first.places[own], found[0].p_pair[own], own)
    return Pairing(*found, shifts, spread)


def _nobody(first: MovingDroplets, second: MovingDroplets) -> tuple[Partners, Partners]:
    return Partners.none(len(first)), Partners.none(len(second))


def _candidates(first: MovingDroplets, second: MovingDroplets, shifts: FloatArray) -> _Candidates:
    there = first.places + shifts
    near = cKDTree(there).sparse_distance_matrix(cKDTree(second.places), CANDIDATES_VOXEL, output_type="coo_matrix")
    own, other = near.row.astype(np.intp), near.col.astype(np.intp)
    return _Candidates(own, other, second.places[other] - there[own])


def _odds(candidates: _Candidates, first: MovingDroplets, second: MovingDroplets, spread: Spread) -> FloatArray:
    """Of every candidate: that the two are one droplet, over that they are strangers."""
    own, other = candidates.own, candidates.other
    covariance = first.covariance[own] + second.covariance[other] + spread.scatter**2 * np.eye(3)
    far = np.einsum("ni,ni->n", candidates.misses, np.linalg.solve(covariance, candidates.misses[..., None])[..., 0])
    there = np.exp(-0.5 * far) / np.sqrt((2 * np.pi) ** 3 * np.linalg.det(covariance))
    stranger = np.sqrt(_density(first.places)[own] * _density(second.places)[other])
    alike = _alikeness(first.log_sizes[own], second.log_sizes[other], spread.unlikeness, second.log_sizes)
    return np.asarray(spread.share / (1 - spread.share) ** 2 * there / stranger * alike)


def _alikeness(own: FloatArray, other: FloatArray, unlikeness: float, everyone: FloatArray) -> FloatArray:
    """Density of the ratio of sizes of a pair over that of strangers: rare sizes tell more than common ones."""
    middle, width = np.median(everyone), max(float(np.std(everyone)), LEAST_UNLIKENESS)
    ratio, rarity = (other - own) / unlikeness, (0.5 * (own + other) - middle) / width
    return np.asarray(np.exp(-0.5 * ratio**2 + 0.5 * rarity**2) * width / unlikeness)


def _density(places: FloatArray) -> FloatArray:
    """Droplets per cubic voxel around every droplet, by the distance to its eighth neighbour."""
    neighbours = min(DENSITY_NEIGHBOURS, len(places) - 1)
    if not neighbours:
        return np.full(len(places), 1 / CANDIDATES_VOXEL**3)
    distances, _ = cKDTree(places).query(places, k=[neighbours + 1])
    return np.asarray(neighbours / (4 / 3 * np.pi * np.maximum(np.asarray(distances)[:, 0], 0.1) ** 3))


def _likely(candidates: _Candidates, odds: FloatArray, firsts: int, seconds: int) -> FloatArray:
    """Probability of every candidate, among all candidates of both and that neither has a partner."""
    of_own = np.bincount(candidates.own, odds, firsts)[candidates.own]
    of_other = np.bincount(candidates.other, odds, seconds)[candidates.other]
    return np.asarray(odds / (1 + of_own + of_other - odds))


def _renewed(candidates: _Candidates, likely: FloatArray, first: MovingDroplets, second: MovingDroplets) -> Spread:
    """How partners differ, by the candidates, each as much as it is likely."""
    own, other, total = candidates.own, candidates.other, likely.sum() + 1e-12
    known = np.trace(first.covariance[own] + second.covariance[other], axis1=1, axis2=2)
    square = likely @ (np.sum(candidates.misses**2, axis=1) - known) / total / 3
    unlike = likely @ (second.log_sizes[other] - first.log_sizes[own]) ** 2 / total
    share = total / np.sqrt(len(first) * len(second))
    return Spread(
        float(np.sqrt(max(square, LEAST_SCATTER_VOXEL**2))),
        float(np.sqrt(max(unlike, LEAST_UNLIKENESS**2))),
        float(np.clip(share, *SHARES)),
    )


def _partners(candidates: _Candidates, likely: FloatArray, firsts: int, seconds: int) -> tuple[Partners, Partners]:
    return (
        _best(candidates.own, candidates.other, likely, firsts),
        _best(candidates.other, candidates.own, likely, seconds),
    )


def _best(own: Indices, other: Indices, likely: FloatArray, count: int) -> Partners:
    """The most likely candidate of every droplet of one exposure, and how likely the second is."""
    best = Partners.none(count)
    order = np.lexsort((-likely, own))
    places, first = np.unique(own[order], return_index=True)
    top = order[first]
    best.p_pair[places] = likely[top]
    best.partner[places] = np.where(likely[top] > BELIEVED, other[top], -1)
    has_second = np.diff(np.append(first, len(order))) > 1
    best.p_runner_up[places[has_second]] = likely[order[first[has_second] + 1]]
    return best
