"""Which droplet of exposure B is which one of A: probabilities, with *no partner* as one of the answers.

The motion around a droplet says where its partner should be; how far partners scatter around that place, how much they
differ in size, and how many droplets have a partner at all is estimated from the droplets themselves, round by round
(expectation, maximisation). A candidate is weighed against a stranger that happens to be there, by the density of
droplets around it, and against all other candidates of both.

Droplets that find no partner are asked for a motion of their own, as where two sprays cross, or two classes fly at two
speeds. Then all motions are weighed together.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from processing.analysis.velocity.common_motion import FEWEST, REACH_VOXEL, Explained, Indices, common_motion
from processing.analysis.velocity.local_motion import KnownMotion, predicted
from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.analysis.velocity.partners import (
    LEAST_UNLIKENESS,
    Candidates,
    Partners,
    Spread,
    candidates_near,
    likely_of,
    odds_of,
    partners_of,
)
from processing.geometry import FloatArray

ROUNDS = 8
LEAST_SCATTER_VOXEL = 0.02
SHARES = (0.01, 0.98)
"""Of the droplets that have a partner: how sure of it one may be."""
MOST_MOTIONS = 4
FAR_VOXEL = 3 * REACH_VOXEL
"""The largest displacement that droplets are asked for to which the motion of the others gives no partner."""
EXPLAINED, LEAST_EXPLAINED_VOXEL = 4.0, 2.5
"""Scatters of a motion, and voxels, within which a displacement is no other one."""


@dataclass(frozen=True, eq=False)
class Pairing:
    """Partners of all droplets of two exposures.

    Parameters
    ----------
    first, second : Partners
        Of the droplets of A, and of B.
    motions : (M, N, 3) array
        Where droplets of A should have gone by their neighbours in each motion that is common to some, in voxels.
    motion : (N,) int array
        In which one a droplet of A has its partner; -1 where it has none.
    spread : Spread
        How partners differ in the first motion.
    """

    first: Partners
    second: Partners
    motions: FloatArray
    motion: Indices
    spread: Spread

    @property
    def shifts(self) -> FloatArray | None:
        """Where droplets should have gone, (N, 3) voxels, without a partner in the first motion; None without any."""
        if not len(self.motions):
            return None
        return np.asarray(self.motions[np.maximum(self.motion, 0), np.arange(len(self.motion))])

    def disbelieved(self) -> "Pairing":
        """The same without partners; probabilities stay."""
        nobody = [replace(one, partner=np.full_like(one.partner, -1)) for one in (self.first, self.second)]
        return replace(self, first=nobody[0], second=nobody[1], motion=np.full_like(self.motion, -1))

    @property
    def pairs(self) -> tuple[Indices, Indices]:
        """Indices of A and of B."""
        (own,) = np.nonzero(self.first.partner >= 0)
        return own, self.first.partner[own]


@dataclass(frozen=True, eq=False)
class _Motion:
    """Displacements that are known of a motion, and how partners in it differ."""

    known: KnownMotion
    spread: Spread = field(default_factory=Spread)


@dataclass(frozen=True, eq=False)
class _Weighed:
    """Candidates of all motions, each pair in that which makes it likelier, and how likely each is."""

    candidates: Candidates
    motion: Indices
    likely: FloatArray


def pair(first: MovingDroplets, second: MovingDroplets) -> Pairing:
    """Pair the droplets of A with those of B; no displacement need be known, it may be as large as 25 voxels.

    What has no partner by then may fly in another motion, by up to 75 voxels.

    Parameters
    ----------
    first, second : MovingDroplets
        Of A and B. Neither their order nor the axes matter.
    """
    nobody = Partners.none(len(first)), Partners.none(len(second))
    pairing = Pairing(*nobody, np.empty((0, len(first), 3)), nobody[0].partner, Spread())
    motions: tuple[_Motion, ...] = ()
    while len(motions) < MOST_MOTIONS:
        further = _further(pairing, motions, first, second)
        if further is None or (settled := _settled((*motions, further), first, second)) is None:
            break
        pairing, motions = settled
    return pairing


def _further(
    pairing: Pairing, motions: tuple[_Motion, ...], first: MovingDroplets, second: MovingDroplets
) -> _Motion | None:
    """The motion of droplets without a partner; None where they have none in common."""
    own, other = (np.flatnonzero(side.partner < 0) for side in (pairing.first, pairing.second))
    explained = [
        Explained(shifts[own], max(EXPLAINED * motion.spread.scatter, LEAST_EXPLAINED_VOXEL))
        for shifts, motion in zip(pairing.motions, motions, strict=True)
    ]
    common = common_motion(first.where(own), second.where(other), FAR_VOXEL if motions else REACH_VOXEL, explained)
    known = KnownMotion(common.places, common.shifts, np.ones(len(common)), np.full(len(common), -1))
    return _Motion(known) if len(common) else None


def _settled(
    motions: tuple[_Motion, ...], first: MovingDroplets, second: MovingDroplets
) -> tuple[Pairing, tuple[_Motion, ...]] | None:
    """Partners in all motions together; None where one of them is left without."""
    for _ in range(ROUNDS):
        shifts = np.array([predicted(motion.known, first.places) for motion in motions])
        weighed = _weighed(motions, shifts, first, second)
        found = partners_of(weighed.candidates, weighed.likely, len(first), len(second))
        motion = _motion_of(weighed, found[0])
        if np.bincount(motion[motion >= 0], minlength=len(motions)).min() < FEWEST:
            return None
        spreads = _renewed(motions, weighed, first, second)
        known = [_known(found[0], np.flatnonzero(motion == one), first, second) for one in range(len(motions))]
        motions = tuple(map(_Motion, known, spreads))
    return Pairing(*found, shifts, motion, motions[0].spread), motions


def _weighed(
    motions: tuple[_Motion, ...], shifts: FloatArray, first: MovingDroplets, second: MovingDroplets
) -> _Weighed:
    each = [candidates_near(first, second, one) for one in shifts]
    odds = [odds_of(one, first, second, motion.spread) for one, motion in zip(each, motions, strict=True)]
    candidates, every, motion = (
        Candidates.joined(each),
        np.concatenate(odds),
        np.repeat(range(len(each)), list(map(len, odds))),
    )
    order = np.lexsort((-every, candidates.other, candidates.own))
    ends = candidates.own[order] * len(second) + candidates.other[order]
    best = order[np.flatnonzero(np.diff(ends, prepend=-1))]
    likeliest = candidates.where(best)
    return _Weighed(likeliest, motion[best], likely_of(likeliest, every[best]))


def _motion_of(weighed: _Weighed, found: Partners) -> Indices:
    """In which motion each droplet of A has its partner; -1 where it has none."""
    own, other = weighed.candidates.own, weighed.candidates.other
    chosen, motion = found.partner[own] == other, np.full(len(found.partner), -1, np.intp)
    motion[own[chosen]] = weighed.motion[chosen]
    return motion


def _known(found: Partners, own: Indices, first: MovingDroplets, second: MovingDroplets) -> KnownMotion:
    """Displacements of some droplets of A that have a partner."""
    displacements = second.places[found.partner[own]] - first.places[own]
    return KnownMotion(first.places[own], displacements, found.p_pair[own], own)


def _renewed(
    motions: tuple[_Motion, ...], weighed: _Weighed, first: MovingDroplets, second: MovingDroplets
) -> list[Spread]:
    """How partners differ in each motion, by its candidates."""
    spreads = []
    for one, motion in enumerate(motions):
        (own,) = np.nonzero(weighed.motion == one)
        spreads.append(_spread_of(motion.spread, weighed.candidates.where(own), weighed.likely[own], first, second))
    return _shared(spreads)


def _shared(spreads: list[Spread]) -> list[Spread]:
    """The same, where not more droplets have a partner in all motions together than may be sure of it."""
    shares = np.array([one.share for one in spreads])
    shares = np.maximum(shares, SHARES[0]) * min(1.0, SHARES[1] / np.maximum(shares, SHARES[0]).sum())
    return [
        replace(one, share=float(share), elsewhere=float(shares.sum() - share))
        for one, share in zip(spreads, shares, strict=True)
    ]


def _spread_of(
    spread: Spread, candidates: Candidates, likely: FloatArray, first: MovingDroplets, second: MovingDroplets
) -> Spread:
    """How partners differ, by the candidates, each as much as it is likely, and as well as its place is known.

    One droplet with an error of voxels must not hide by how much the places of all others miss.
    """
    own, other, total = candidates.own, candidates.other, likely.sum() + 1e-12
    known = np.trace(first.covariance[own] + second.covariance[other], axis1=1, axis2=2) / 3
    telling = likely / (known + spread.scatter**2) ** 2
    square = telling @ (np.sum(candidates.misses**2, axis=1) / 3 - known) / (telling.sum() + 1e-12)
    unlike = likely @ (second.log_sizes[other] - first.log_sizes[own]) ** 2 / total
    return Spread(
        float(np.sqrt(max(square, LEAST_SCATTER_VOXEL**2))),
        float(np.sqrt(max(unlike, LEAST_UNLIKENESS**2))),
        float(total / np.sqrt(len(first) * len(second))),
    )
