"""What the velocities of some shots say of a spray, as their files have them."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field
from scipy.special import stdtrit

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.droplets.droplet_statistics import require_poolable
from processing.analysis.droplets.ghost_share import share_interval
from processing.analysis.estimates import CONFIDENCE, Estimate
from processing.analysis.shot_doubts import COMPONENTS, velocity_doubts
from processing.analysis.stored_json import stored_json
from processing.analysis.velocity.unpaired_ghosts import ghost_share_by_partners
from processing.geometry import FloatArray
from processing.reconstruction.settings import FrozenValue

NOTHING = "no shot was measured"
ONE_PAIR = "a single pair of droplets, which does not tell how velocities differ: measure more shots"
OLD = "a file does not tell velocities: it is from before they were measured"


class MeanVelocity(FrozenValue):
    """Mean of the velocities of all pairs, each pair counting once: a spatial mean."""

    u: Annotated[Estimate, Field(description="along x")]
    v: Annotated[Estimate, Field(description="along y")]
    w: Annotated[Estimate, Field(description="along z")]


class VelocityStatistics(FrozenValue):
    """Velocities of a spray; where one is missing, ``reason`` says why."""

    shots: Annotated[int, Field(description="whose velocities are not refused")]
    pairs: Annotated[int, Field(description="of droplets of exposures A and B")]
    share_paired: Annotated[
        Estimate | None,
        Field(description="of the droplets of A that should be in B, too; its interval by counting alone"),
    ] = None
    mean_m_s: Annotated[MeanVelocity | None, Field(description="of all pairs")] = None
    intervals_over: Annotated[
        Literal["shots", "pairs"] | None, Field(description="what the interval of the mean knows to differ")
    ] = None
    unpaired_ghost_share: Annotated[
        Estimate | None,
        Field(description="ghosts among the droplets, by those without a partner: a witness beside ghost_share"),
    ] = None
    unpaired_ghost_reason: Annotated[str | None, Field(description="why it is null, where there are pairs")] = None
    reason: Annotated[str | None, Field(description="why there is no mean; null where there is one")] = None
    doubts: Annotated[tuple[str, ...], Field(description="velocities that are doubtful, and count, or refused")] = ()


def velocity_statistics(shots: Iterable[StoredDroplets]) -> VelocityStatistics:
    """Pairs, share of paired droplets and mean velocity of all shots whose velocities are not refused.

    Parameters
    ----------
    shots : iterable of StoredDroplets
        A shot each, as ``read_droplets`` gives it.

    Raises
    ------
    DropletFileError
        As of ``droplet_statistics``: a shot is there twice, or two are of two recipes or calibrations.
    """
    shots = tuple(shots)
    require_poolable(shots)
    told = [(shot, _told(shot)) for shot in shots]
    believed = [(shot, its) for shot, its in told if its.get("pairs")]
    if not believed:
        reason = _why(its for _, its in told)
        return VelocityStatistics(shots=0, pairs=0, reason=reason, doubts=velocity_doubts(shots))
    velocities_m_s = [_of_pairs(shot) for shot, _ in believed]
    pairs, stayed = sum(map(len, velocities_m_s)), sum(its["stayed"] for _, its in believed)
    several = len(believed) > 1
    low, high = share_interval(min(pairs, stayed), stayed)
    ghosts = ghost_share_by_partners([shot for shot, _ in believed])
    return VelocityStatistics(
        shots=len(believed),
        pairs=pairs,
        share_paired=Estimate(value=min(1.0, pairs / stayed), low=low, high=high),
        mean_m_s=_mean(velocities_m_s),
        intervals_over="shots" if several else "pairs",
        unpaired_ghost_share=None if isinstance(ghosts, str) else ghosts,
        unpaired_ghost_reason=ghosts if isinstance(ghosts, str) else None,
        reason=None if pairs > 1 else ONE_PAIR,
        doubts=velocity_doubts(shots),
    )


def _told(shot: StoredDroplets) -> Mapping[str, Any]:
    return stored_json(shot.provenance, "velocity") or {"reason": OLD}


def _why(told: Iterable[Mapping[str, Any]]) -> str:
    reasons = [reason for its in told for reason in ([its["reason"]] if "reason" in its else its["reasons"])]
    return "; ".join(dict.fromkeys(reasons)) or NOTHING


def _of_pairs(shot: StoredDroplets) -> FloatArray:
    """Velocities (N, 3) of the droplets of A that have a partner."""
    paired = (shot.columns["frame"] == "a") & np.isfinite(np.asarray(shot.columns[COMPONENTS[0]], np.float64))
    return np.column_stack([np.asarray(shot.columns[name], np.float64)[paired] for name in COMPONENTS])


def _mean(shots: Sequence[FloatArray]) -> MeanVelocity | None:
    """Mean of the pairs (N, 3) of shots; its limits are nowhere narrower than those over pairs. None of one pair."""
    rows = np.concatenate(shots)
    if len(rows) < 2:
        return None
    mean = rows.mean(axis=0)
    reach = _reach(rows - mean)
    if len(shots) > 1:
        reach = np.maximum(reach, _reach(np.array([np.sum(shot - mean, axis=0) for shot in shots])))
    u, v, w = (
        Estimate(value=value, low=value - half, high=value + half)
        for value, half in zip(mean.tolist(), (reach / len(rows)).tolist(), strict=True)
    )
    return MeanVelocity(u=u, v=v, w=w)


def _reach(apart: FloatArray) -> FloatArray:
    """From a sum to its limits, by how far apart from the mean its terms (units, 3) are."""
    units = len(apart)
    sd = np.sqrt(np.sum(apart**2, axis=0) * units / (units - 1))
    return np.asarray(stdtrit(units - 1, (1 + CONFIDENCE) / 2) * sd)
