"""The time between the exposures that lets droplets move by about five voxels: proposed from the shots of a trial."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field
from scipy.special import stdtrit

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.estimates import CONFIDENCE, Estimate
from processing.analysis.shot_doubts import COMPONENTS, velocity_doubts
from processing.analysis.velocity.common_motion import REACH_VOXEL
from processing.analysis.velocity.velocity_statistics import velocity_statistics
from processing.geometry import FloatArray
from processing.reconstruction.settings import FrozenValue, GridSettings

MOVED_VOXEL = 5.0
"""Errors of velocities fall with it; gradients, scatter and droplets that leave the box grow."""
FAST_SHARE, FARTHEST_VOXEL = 0.95, 0.8 * REACH_VOXEL
"""So many droplets should not go farther: partners are looked for up to ``REACH_VOXEL``."""
ROUND_NS = 10
MM_PER_M_S_NS = 1e-6
"""A metre per second is so many millimetres per nanosecond."""
REMEDY = (
    f"where droplets move by more than {REACH_VOXEL:g} voxels, record with a third of the separation, and ask again"
)


class SeparationProposal(FrozenValue):
    """A separation that is proposed, and why; or why none is."""

    shots: Annotated[int, Field(description="whose velocities are not refused")]
    pairs: Annotated[int, Field(description="of droplets")] = 0
    separation_ns: Annotated[int | None, Field(description="proposed, start to start of the pulses")] = None
    wanted_ns: Annotated[
        Estimate | None, Field(description="without limits, with its interval over shots; null of a single shot")
    ] = None
    will_move_voxel: Annotated[float | None, Field(description="the median droplet, with what is proposed")] = None
    fast_will_move_voxel: Annotated[float | None, Field(description="95 % of the droplets move by less")] = None
    reason: Annotated[str | None, Field(description="why none is proposed, or why not what is wanted")] = None
    doubts: Annotated[tuple[str, ...], Field(description="velocities that are doubtful, and count, or refused")] = ()


def propose_separation(
    shots: Sequence[StoredDroplets],
    window_ns: tuple[int, int] | None = None,
    moved_voxel: float = MOVED_VOXEL,
) -> SeparationProposal:
    """Propose a separation from the velocities of some shots; three tell whether they differ.

    Parameters
    ----------
    shots : sequence of StoredDroplets
        A shot each, as ``read_droplets`` gives it.
    window_ns : (shortest, longest), optional
        That the cameras accept.
    moved_voxel : float
        Wanted of the median droplet.
    """
    rates = [rates_of(shot) for shot in shots]
    known = [one for one in rates if len(one)]
    if not known:
        told = velocity_statistics(shots)
        return SeparationProposal(shots=0, reason=f"{told.reason}; {REMEDY}", doubts=told.doubts)
    every = np.concatenate(known)
    rate, fast = float(np.median(every)), float(np.quantile(every, FAST_SHARE))
    wanted_ns = moved_voxel / rate
    proposed_ns, reason = _allowed(wanted_ns, FARTHEST_VOXEL / fast, window_ns)
    return SeparationProposal(
        shots=len(known),
        pairs=len(every),
        separation_ns=proposed_ns,
        wanted_ns=_estimated(wanted_ns, [moved_voxel / float(np.median(one)) for one in known]),
        will_move_voxel=rate * proposed_ns,
        fast_will_move_voxel=fast * proposed_ns,
        reason=reason,
        doubts=velocity_doubts(shots),
    )


def rates_of(shot: StoredDroplets) -> FloatArray:
    """Voxels per ns (N,) of the droplets of A that have a partner; none where velocities are refused, or not there."""
    if COMPONENTS[0] not in shot.columns:
        return np.empty(0)
    first = shot.columns["frame"] == "a"
    speeds_m_s = np.linalg.norm([np.asarray(shot.columns[name], np.float64)[first] for name in COMPONENTS], axis=0)
    pitch_mm = GridSettings.model_validate_json(str(shot.provenance["grid"])).pitch_mm
    return np.asarray(speeds_m_s[np.isfinite(speeds_m_s)] * MM_PER_M_S_NS / pitch_mm)


def _allowed(wanted_ns: float, farthest_ns: float, window_ns: tuple[int, int] | None) -> tuple[int, str | None]:
    """What is wanted within limits, and why it is not all of it."""
    reason = None
    if wanted_ns > farthest_ns:
        wanted_ns, reason = farthest_ns, f"5 % of the droplets would move by more than {FARTHEST_VOXEL:g} voxels"
    shortest_ns, longest_ns = window_ns or (1, 10**12)
    within_ns = float(np.clip(wanted_ns, shortest_ns, longest_ns))
    if within_ns != wanted_ns:
        reason = f"cameras accept {shortest_ns} to {longest_ns} ns; {wanted_ns:.0f} ns were wanted"
    rounded_ns = ROUND_NS * round(within_ns / ROUND_NS)
    return int(np.clip(rounded_ns, shortest_ns, longest_ns)), reason


def _estimated(value: float, by_shot: Sequence[float]) -> Estimate | None:
    """With its interval over shots, by their logarithms; None of a single shot."""
    if len(by_shot) < 2:
        return None
    sd = float(np.std(np.log(by_shot), ddof=1)) / np.sqrt(len(by_shot))
    reach = float(np.exp(stdtrit(len(by_shot) - 1, (1 + CONFIDENCE) / 2) * sd))
    return Estimate(value=value, low=value / reach, high=value * reach)
