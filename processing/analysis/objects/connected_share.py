"""Break-up length of a spray from many shots: with which probability liquid still hangs together with the nozzle.

A shot counts in parts: one per threshold that tells, as a bridge of liquid, or a gap, may be seen by some of them only.
Shots whose liquid leaves the field while it still hangs together are *censored*: known to be longer. So shares are by
Kaplan and Meier (1958). Limits are of 95 %, by a bootstrap that draws shots, a threshold with each set of them, and
with each shot how much too long or too short it may look.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.analysis.objects.break_up import NEAR_MM, TELLING, Reach
from processing.count import counted
from processing.geometry import FloatArray

DRAWS, LIMITS_PERCENT = 1000, (2.5, 97.5)
LOOKS_LONGER_VOXEL = (-24.0, 48.0)
"""What no threshold shows: film too thin to be seen; gaps below a pixel, and bodies one behind the other in all views.
Of 65 simulated shots six look 0.5 to 1.3 mm longer than they are, four 0.5 to 0.8 mm shorter; 24 voxels are 0.5 mm."""


@dataclass(frozen=True)
class BreakUp:
    """Break-up length of a spray.

    Parameters
    ----------
    shots : int
        Of which it is known.
    value_mm, low_mm, high_mm : float | None
        Distance along the axis at which half of the shots still hang together; limits include how it depends on the
        threshold, and what no threshold shows. ``high_mm`` is None where it lies beyond the field.
    longer_than_mm : float | None
        Where more than half still hang together when they leave the field.
    reason : str | None
        Why there is no value, why it is not known of some shots, and of how many a large body lies apart: up to the end
        of that the limits go then.
    """

    shots: int = 0
    value_mm: float | None = None
    low_mm: float | None = None
    high_mm: float | None = None
    longer_than_mm: float | None = None
    reason: str | None = None


@dataclass(frozen=True, eq=False)
class ConnectedShare:
    """Share of the shots whose liquid hangs together with the nozzle, over the distance along the axis.

    Parameters
    ----------
    distances_mm : (N,) array
        From the nozzle.
    share, low, high : (N,) arrays
        By all thresholds that tell, and limits of 95 %; not a number beyond the field.
    """

    distances_mm: FloatArray
    share: FloatArray
    low: FloatArray
    high: FloatArray


def break_up_of(shots: Sequence[Reach], seed: int = 0) -> BreakUp:
    """Break-up length from one exposure each of some shots."""
    known = [shot for shot in shots if shot.reason is None]
    reasons = "; ".join(dict.fromkeys(shot.reason for shot in shots if shot.reason))
    if not known:
        return BreakUp(reason=reasons or "no shot was measured")
    unknown = f"not known of {len(shots) - len(known)} of {counted(len(shots), 'shot')}: {reasons}" if reasons else None
    doubts = "; ".join(filter(None, (_apart(known), _behind(known), unknown))) or None
    reach_mm, leaves = _table(known)
    value_mm = _half_connected_mm(reach_mm.ravel(), leaves.ravel())
    drawn_mm = np.sort([_half_connected_mm(*draw) for draw in _draws(known, seed)])
    low_mm, high_mm = (drawn_mm[round((DRAWS - 1) * percent / 100)] for percent in LIMITS_PERCENT)
    if not np.isfinite(value_mm):
        longer_mm = float(np.median(reach_mm))
        longer = f"still connected where it leaves the field: longer than {longer_mm:.2f} mm"
        return BreakUp(len(known), longer_than_mm=longer_mm, reason="; ".join(filter(None, (longer, doubts))))
    low_mm, high_mm = min(low_mm, value_mm), max(high_mm, value_mm, _half_connected_mm(*_joined(known)))
    high = float(high_mm) if np.isfinite(high_mm) else None
    return BreakUp(len(known), value_mm, float(low_mm), high, reason=doubts)


def connected_share(shots: Sequence[Reach], distances_mm: FloatArray, seed: int = 0) -> ConnectedShare:
    """The curve from one exposure each of some shots, of which at least one is known."""
    known = [shot for shot in shots if shot.reason is None]
    reach_mm, leaves = _table(known)
    curves = [_share(*draw, distances_mm) for draw in _draws(known, seed)]
    share = _share(reach_mm.ravel(), leaves.ravel(), distances_mm)
    filled = np.where(np.isnan(curves), share, curves)
    low, high = np.percentile(filled, LIMITS_PERCENT, axis=0)
    return ConnectedShare(distances_mm, share, np.fmin(low, share), np.fmax(high, share))


Lengths = tuple[FloatArray, NDArray[np.bool_]]


def _table(shots: Sequence[Reach]) -> Lengths:
    """Lengths and whether they are open, (shots, thresholds that tell)."""
    telling = [shots[0].thresholds.index(threshold) for threshold in TELLING]
    reach_mm, leaves = np.array([shot.reach_mm for shot in shots]), np.array([shot.open for shot in shots], bool)
    return reach_mm[:, telling], leaves[:, telling]


def _apart(shots: Sequence[Reach]) -> str | None:
    """Of how many shots a large body lies apart."""
    spans_mm = [shot.apart_mm for shot in shots if shot.apart_mm]
    if not spans_mm:
        return None
    first_mm, last_mm = np.median(spans_mm, axis=0)
    return (
        f"in {len(spans_mm)} of {counted(len(shots), 'shot')} a large body, {first_mm:.2f} to {last_mm:.2f} mm from "
        "the nozzle along the axis, does not hang together with it: torn off, joined by film too thin to be seen, or "
        "is the nozzle stated wrongly?"
    )


def _behind(shots: Sequence[Reach]) -> str | None:
    """In how many shots liquid begins before the nozzle does."""
    behind_mm = [shot.behind_mm for shot in shots if shot.behind_mm > NEAR_MM]
    if not behind_mm:
        return None
    return (
        f"in {len(behind_mm)} of {counted(len(shots), 'shot')} what hangs together goes {np.median(behind_mm):.2f} mm "
        "behind the nozzle, and the length is told from there, where it is stated: is that its place? If it is the "
        "nozzle that is seen, leave its pixels unasked (--ignore)"
    )


def _joined(shots: Sequence[Reach]) -> Lengths:
    """Lengths as if bodies that lie apart did hang together with the nozzle."""
    reach_mm, leaves = _table(shots)
    ends_mm = np.array([[shot.apart_mm[1] if shot.apart_mm else 0.0] for shot in shots])
    longer_mm = np.maximum(reach_mm, ends_mm)
    return longer_mm.ravel(), leaves.ravel()


def _draws(shots: Sequence[Reach], seed: int) -> list[Lengths]:
    rng = np.random.default_rng(seed)
    reach_mm, leaves = _table(shots)
    chosen = rng.integers(len(shots), size=(DRAWS, len(shots)))
    by = rng.integers(reach_mm.shape[1], size=(DRAWS, 1))
    longer_mm = rng.uniform(*LOOKS_LONGER_VOXEL, size=chosen.shape) * shots[0].voxel_mm
    return list(zip(np.maximum(reach_mm[chosen, by] - longer_mm, 0), leaves[chosen, by], strict=True))


def _half_connected_mm(reach_mm: FloatArray, leaves: NDArray[np.bool_]) -> float:
    """Where the share falls to a half; infinite where it does not within the field."""
    ends_mm, shares = _steps(reach_mm, leaves)
    below = np.flatnonzero(shares <= 0.5 + 1e-9)
    if not len(below):
        return float("inf")
    first = below[0]
    even = abs(shares[first] - 0.5) < 1e-9 and first + 1 < len(ends_mm)
    return float(ends_mm[first : first + 1 + even].mean())


def _share(reach_mm: FloatArray, leaves: NDArray[np.bool_], distances_mm: FloatArray) -> FloatArray:
    ends_mm, shares = _steps(reach_mm, leaves)
    known = np.concatenate([[1.0], shares])[np.searchsorted(ends_mm, distances_mm, side="left")]
    beyond = (distances_mm > reach_mm.max()) & leaves[reach_mm.argmax()]
    return np.where(beyond, np.nan, known)


def _steps(reach_mm: FloatArray, leaves: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray]:
    """Distances at which liquid ends, and the share beyond each."""
    ends_mm = np.unique(reach_mm[~leaves])
    at_risk = np.array([np.count_nonzero(reach_mm >= end_mm) for end_mm in ends_mm])
    ending = np.array([np.count_nonzero(reach_mm[~leaves] == end_mm) for end_mm in ends_mm])
    return ends_mm, np.cumprod(1 - ending / np.maximum(at_risk, 1))
