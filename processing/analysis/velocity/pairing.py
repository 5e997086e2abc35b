"""Which droplet of exposure B is which one of A: probabilities, with *no partner* as one of the answers.

The motion around a droplet says where its partner should be; how far partners scatter around that place, how much they
differ in size, and how many droplets have a partner at all is estimated from the droplets themselves, round by round
(expectation, maximisation). A candidate is weighed against a stranger that happens to be there, by the density of
droplets around it, and against all other candidates of both.
"""

from dataclasses import dataclass, replace

import numpy as np

from processing.analysis.velocity.common_motion import FEWEST, Indices, common_motion
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


def pair(first: MovingDroplets, second: MovingDroplets) -> Pairing:
    """Pair the droplets of A with those of B; no displacement need be known, it may be as large as 25 voxels.

    Parameters
    ----------
    first, second : MovingDroplets
        Of A and B. Neither their order nor the axes matter.
    """
    common, spread = common_motion(first, second), Spread()
    known = KnownMotion(common.places, common.shifts, np.ones(len(common)), np.full(len(common), -1))
    found, shifts = _nobody(first, second), None
    for _ in range(ROUNDS if len(common) else 0):
        shifts = predicted(known, first.places)
        candidates = candidates_near(first, second, shifts)
        likely = likely_of(candidates, odds_of(candidates, first, second, spread))
        spread = _renewed(spread, candidates, likely, first, second)
        found = partners_of(candidates, likely, len(first), len(second))
        (own,) = np.nonzero(found[0].partner >= 0)
        if len(own) < FEWEST:
            return Pairing(*_nobody(first, second), None, spread)
        other = found[0].partner[own]
        known = KnownMotion(first.places[own], second.places[other] - first.places[own], found[0].p_pair[own], own)
    return Pairing(*found, shifts, spread)


def _nobody(first: MovingDroplets, second: MovingDroplets) -> tuple[Partners, Partners]:
    return Partners.none(len(first)), Partners.none(len(second))


def _renewed(
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
    share = total / np.sqrt(len(first) * len(second))
    return Spread(
        float(np.sqrt(max(square, LEAST_SCATTER_VOXEL**2))),
        float(np.sqrt(max(unlike, LEAST_UNLIKENESS**2))),
        float(np.clip(share, *SHARES)),
    )
