"""Whether to believe the velocities of a double exposure."""

import numpy as np

from processing.analysis.droplets.droplet_table import DropletRows
from processing.analysis.droplets.measured_exposure import MeasuredExposure, Seen, ShotVerdict
from processing.analysis.two_exposures.alone_droplets import Alone
from processing.analysis.velocity.common_motion import REACH_VOXEL
from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.analysis.velocity.pairing import Pairing
from processing.geometry import FloatArray

LEAST_SHARE, TRUSTED_SHARE = 0.1, 0.5
"""Of the droplets that should be in the grid in both: with fewer pairs velocities are refused, or doubtful."""
MOST_WRONG = 0.02
"""Of the pairs, by their own probabilities."""
FASTEST_M_S = 1000.0
"""No spray is as fast; diesel at 300 MPa leaves its nozzle with 800 m/s."""
LEAST_NOISE = 0.1
"""Of the noise of displacements. An image that is there twice has none."""
STILL, MOST_STILL = 2.0, 0.5
"""Standard deviations of displacement or velocity below which nothing is known to move, and share of the droplets of
a motion."""
Verdict = tuple[ShotVerdict, tuple[str, ...]]


def judged(
    exposures: tuple[MeasuredExposure[DropletRows, Seen], MeasuredExposure[DropletRows, Seen]],
    droplets: tuple[MovingDroplets, MovingDroplets],
    pairing: Pairing,
    stayed: int,
    alone: Alone,
) -> Verdict:
    """Verdict and reasons.

    Parameters
    ----------
    exposures : two MeasuredExposure
        A and B: velocities are no better than what they come from.
    droplets : two MovingDroplets
        Theirs.
    pairing : Pairing
        Of the two.
    stayed : int
        Droplets of A that should be in the grid in B, too.
    alone : Alone
        Droplets of both that should have a partner, and have none.
    """
    for name, exposure in zip("AB", exposures, strict=True):
        if exposure.verdict in (ShotVerdict.EMPTY, ShotVerdict.REFUSED):
            return exposure.verdict, (f"exposure {name} is {exposure.verdict}: without droplets no velocities",)
    own, _ = pairing.pairs
    if not len(own):
        return ShotVerdict.REFUSED, (_nothing_common(*droplets),)
    if _is_copy(droplets, pairing):
        reason = "droplets are in A where they are in B, better than noise allows: one image is there twice"
        return ShotVerdict.REFUSED, (reason,)
    share, wrong = len(own) / max(stayed, 1), float(np.mean(1 - pairing.first.p_pair[own]))
    if share < LEAST_SHARE:
        return ShotVerdict.REFUSED, (_few(share, LEAST_SHARE),)
    doubts = [f"exposure {name} is doubtful" for name, one in zip("AB", exposures, strict=True) if one.reasons]
    doubts += [_ambiguous(wrong)] if wrong > MOST_WRONG else []
    doubts += [_few(share, TRUSTED_SHARE)] if share < TRUSTED_SHARE else alone.told
    doubts += [_at_rest(still)] if (still := _still_share(droplets, pairing)) else []
    return (ShotVerdict.DOUBTFUL if doubts else ShotVerdict.GOOD), tuple(doubts)


def _nothing_common(first: MovingDroplets, second: MovingDroplets) -> str:
    return (
        f"the {len(first)} droplets of A and the {len(second)} of B have no motion in common: are they too few, of two "
        f"shots, or farther apart than {REACH_VOXEL:g} voxels? Then shorten the separation"
    )


def _is_copy(droplets: tuple[MovingDroplets, MovingDroplets], pairing: Pairing) -> bool:
    moved, variances = _moved(droplets, pairing)
    return bool(np.median(moved**2 - LEAST_NOISE**2 * variances) <= 0)


def _still_share(droplets: tuple[MovingDroplets, MovingDroplets], pairing: Pairing) -> float:
    """Of the droplets with a partner, those in motions in which most are not known to move."""
    moved, variances = _moved(droplets, pairing)
    still, motion = np.sum(moved**2, axis=1) < STILL**2 * np.sum(variances, axis=1), pairing.motion[pairing.motion >= 0]
    of_motions = [still[motion == one] for one in range(len(pairing.motions))]
    return sum(np.count_nonzero(one) for one in of_motions if np.mean(one) > MOST_STILL) / len(still)


def _moved(droplets: tuple[MovingDroplets, MovingDroplets], pairing: Pairing) -> tuple[FloatArray, FloatArray]:
    """Displacement of every pair (N, 3), in voxels, and its variances."""
    first, second = droplets
    own, other = pairing.pairs
    variances = np.einsum("nii->ni", first.covariance[own] + second.covariance[other])
    return second.places[other] - first.places[own], variances


def _few(share: float, limit: float) -> str:
    return (
        f"{100 * share:.0f} % of the droplets that should be in both exposures have a partner, limit {100 * limit:.0f} "
        "%: are A and B of one shot, and are droplets seen in both?"
    )


def _at_rest(share: float) -> str:
    return (
        f"{100 * share:.0f} % of the droplets stand still from A to B, as sure as that is known: is it dirt, or are "
        "both exposures of one flash? A longer separation tells slow droplets"
    )


def _ambiguous(wrong: float) -> str:
    return (
        f"{100 * wrong:.1f} % of the pairs are wrong by their own probabilities, limit {100 * MOST_WRONG:.0f} %: "
        "shorten the separation, or take those with a high p_pair"
    )
