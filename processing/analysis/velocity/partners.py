"""Candidates for a partner, and how likely each is: against strangers, against each other, and against no partner."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import min_weight_full_bipartite_matching
from scipy.spatial import cKDTree

from processing.analysis.velocity.common_motion import Indices
from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.geometry import FloatArray

CANDIDATES_VOXEL = 8.0
"""So far from where it should be a partner is looked for."""
BELIEVED = 0.5
"""More likely than all else together."""
FIRST_SCATTER_VOXEL, FIRST_UNLIKENESS, FIRST_SHARE = 1.5, 0.5, 0.5
LEAST_UNLIKENESS = 0.02
DENSITY_NEIGHBOURS = 8
RAREST = 3.0
"""Standard deviations from the median size: rarer sizes tell no more."""


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
    elsewhere : float
        Of the droplets that have one in another motion.
    """

    scatter: float = FIRST_SCATTER_VOXEL
    unlikeness: float = FIRST_UNLIKENESS
    share: float = FIRST_SHARE
    elsewhere: float = 0.0

    @property
    def alone(self) -> float:
        """Share of the droplets without any partner."""
        return 1 - self.share - self.elsewhere


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
class Candidates:
    """Pairs that may be: indices of A and B, and how far B is from where A should have gone."""

    own: Indices
    other: Indices
    misses: FloatArray

    @classmethod
    def joined(cls, several: "Sequence[Candidates]") -> "Candidates":
        """All of them, one after the other."""
        return cls(*(np.concatenate([getattr(one, name) for one in several]) for name in ("own", "other", "misses")))

    def where(self, chosen: Indices) -> "Candidates":
        """The chosen ones, by index."""
        return Candidates(self.own[chosen], self.other[chosen], self.misses[chosen])


def candidates_near(first: MovingDroplets, second: MovingDroplets, shifts: FloatArray) -> Candidates:
    """Pairs (A, B) of which B is near the place where A should have gone.

    Parameters
    ----------
    first, second : MovingDroplets
        Of A and B.
    shifts : (N, 3) array
        Where droplets of A should have gone, in voxels.
    """
    there = first.places + shifts
    near = cKDTree(there).sparse_distance_matrix(cKDTree(second.places), CANDIDATES_VOXEL, output_type="coo_matrix")
    own, other = near.row.astype(np.intp), near.col.astype(np.intp)
    return Candidates(own, other, second.places[other] - there[own])


def odds_of(candidates: Candidates, first: MovingDroplets, second: MovingDroplets, spread: Spread) -> FloatArray:
    """Of every candidate: that the two are one droplet, over that they are strangers."""
    own, other = candidates.own, candidates.other
    if not len(own):
        return np.empty(0)
    covariance = first.covariance[own] + second.covariance[other] + spread.scatter**2 * np.eye(3)
    far = np.einsum("ni,ni->n", candidates.misses, np.linalg.solve(covariance, candidates.misses[..., None])[..., 0])
    there = np.exp(-0.5 * far) / np.sqrt((2 * np.pi) ** 3 * np.linalg.det(covariance))
    stranger = np.sqrt(_density(first.places)[own] * _density(second.places)[other])
    alike = _alikeness(first.log_sizes[own], second.log_sizes[other], spread.unlikeness, second.log_sizes)
    return np.asarray(spread.share / spread.alone**2 * there / stranger * alike)


def likely_of(candidates: Candidates, odds: FloatArray) -> FloatArray:
    """Probability of every candidate, among all candidates of both and that neither has a partner."""
    of_own, of_other = (np.bincount(ends, odds)[ends] for ends in (candidates.own, candidates.other))
    return np.asarray(odds / (1 + of_own + of_other - odds))


def assigned(candidates: Candidates, odds: FloatArray, firsts: int, seconds: int) -> Indices:
    """Which candidates are partners, each droplet once, if all of them together are to be as likely as can be."""
    alone, costs = np.arange(firsts), -np.log(np.maximum(odds, np.finfo(np.float64).tiny))
    rows, columns = np.append(candidates.own, alone), np.append(candidates.other, seconds + alone)
    costs = np.append(costs, np.zeros(firsts))
    weights = 1 + costs - costs.min(initial=0)  # none may be 0; as each of A has one, that is added to all alike
    graph = csr_array((weights, (rows, columns)), (firsts, seconds + firsts))
    _, partner = min_weight_full_bipartite_matching(graph)
    return np.flatnonzero(partner[candidates.own] == candidates.other)


def _alikeness(own: FloatArray, other: FloatArray, unlikeness: float, everyone: FloatArray) -> FloatArray:
    """Density of the ratio of sizes of a pair over that of strangers: rare sizes tell more than common ones."""
    middle, width = np.median(everyone), max(float(np.std(everyone)), LEAST_UNLIKENESS)
    ratio, rarity = (other - own) / unlikeness, np.clip((0.5 * (own + other) - middle) / width, -RAREST, RAREST)
    return np.asarray(np.exp(-0.5 * ratio**2 + 0.5 * rarity**2) * width / unlikeness)


def _density(places: FloatArray) -> FloatArray:
    """Droplets per cubic voxel around every droplet, by the distance to its eighth neighbour."""
    neighbours = min(DENSITY_NEIGHBOURS, len(places) - 1)
    if not neighbours:
        return np.full(len(places), 1 / CANDIDATES_VOXEL**3)
    distances, _ = cKDTree(places).query(places, k=[neighbours + 1])
    return np.asarray(neighbours / (4 / 3 * np.pi * np.maximum(np.asarray(distances)[:, 0], 0.1) ** 3))


def partners_of(candidates: Candidates, likely: FloatArray, firsts: int, seconds: int) -> tuple[Partners, Partners]:
    """The most likely partner of every droplet of A, and of B."""
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
