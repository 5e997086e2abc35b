"""What became of a shot that was measured: its droplets, its velocities, and whether to believe them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from processing.analysis.droplets.bright_shot import BrightExposure
from processing.analysis.droplets.ghost_share import pooled, told_share
from processing.analysis.droplets.measured_exposure import ShotVerdict
from processing.analysis.droplets.shadows.shadow_shot import ShadowExposure
from processing.analysis.estimates import Estimate
from processing.analysis.shot_doubts import AGAINST, FEWEST_PAIRS, way_of
from processing.analysis.unlike_numbers import unlike_numbers
from processing.analysis.unlike_sizes import unlike_sizes
from processing.analysis.velocity.measured_velocities import MeasuredVelocities, measure_velocities
from processing.reconstruction.settings import FrozenValue
from processing.runs.shots.separation import Separation
from processing.volume import VoxelGrid

Exposure = BrightExposure | ShadowExposure
MOST_SPREAD = 0.01
"""Of the separation: views that differ by more see droplets at different times."""


def compared(exposures: tuple[Exposure, ...], velocities: MeasuredVelocities | None) -> tuple[Exposure, ...]:
    """The same exposures, doubted where A and B differ: in numbers, or in diameters of the very same droplets."""
    if len(exposures) < 2:
        return exposures
    first, second = exposures
    known = all(one.verdict is not ShotVerdict.REFUSED for one in exposures)
    numbers = unlike_numbers(len(first.droplets), len(second.droplets)) if known else ""
    sizes = unlike_sizes(first.droplets, second.droplets, velocities) if velocities else ""
    told = tuple(one for one in (numbers, sizes) if one)
    return tuple(exposure.doubted(told) for exposure in exposures)


class ShotVelocity(FrozenValue):
    """What became of the velocities of a double exposure."""

    verdict: ShotVerdict
    reasons: tuple[str, ...]
    pairs: int
    stayed: int
    share_paired: float | None
    share_alone: float | None
    wrong_share: float | None
    mean_m_s: tuple[float, float, float] | None
    separation_ns: float
    separation_source: Literal["fired", "stated"]


class ShotDroplets(FrozenValue):
    """What became of one shot; of two exposures, the less favourable verdict and ratio, and the larger hidden share."""

    shot: int
    droplets: int
    ghost_share: float | None
    ghost_interval: tuple[float, float] | None
    ghost_reason: str | None
    twin_ghost_share: float | None
    residual_over_noise: float | None
    hidden_share: float
    liquid_objects: int
    verdict: ShotVerdict
    reasons: tuple[str, ...]
    cpu_s: float
    file: str
    velocity: ShotVelocity | None = None
    velocity_reason: str | None = None


@dataclass(frozen=True, eq=False)
class MeasuredShot:
    """A shot that was measured.

    Parameters
    ----------
    summary : ShotDroplets
        What became of it.
    exposures : tuple of MeasuredExposure
        All that was measured.
    velocities : MeasuredVelocities | None
        Of the droplets; None where there is one exposure, or nobody knows the separation.
    """

    summary: ShotDroplets
    exposures: tuple[Exposure, ...]
    velocities: MeasuredVelocities | None = None


def droplets_path(results_dir: Path, shot: int) -> Path:
    """Where the droplets of one shot lie."""
    return results_dir / f"shot_{shot:05d}_droplets.h5"


def shot_velocities(
    exposures: Sequence[Exposure],
    grid: VoxelGrid,
    separation: Separation | str,
    axis: Sequence[float] | None = None,
) -> tuple[MeasuredVelocities | None, ShotVelocity | str]:
    """Velocities of a shot and what to tell of them, or why there are none.

    Parameters
    ----------
    exposures : sequence of MeasuredExposure
        A and B.
    grid : VoxelGrid
        In which they were measured.
    separation : Separation | str
        From A to B, or why nobody knows it.
    axis : (3,) sequence of float, optional
        Along which the spray leaves its nozzle, of any length, where somebody has stated it.
    """
    if isinstance(separation, str):
        return None, separation
    first, second = exposures
    velocities = measure_velocities(first, second, grid, separation.mean_ns)
    return velocities, _told_velocity(velocities, separation, axis)


def _told_velocity(
    velocities: MeasuredVelocities, separation: Separation, axis: Sequence[float] | None
) -> ShotVelocity:
    verdict, reasons = velocities.verdict, velocities.reasons
    if velocities.pairs and (doubts := (*_uneven(separation), *_against(velocities, axis))):
        verdict, reasons = ShotVerdict.DOUBTFUL, (*reasons, *doubts)
    return ShotVelocity(
        verdict=verdict,
        reasons=reasons,
        pairs=velocities.pairs,
        stayed=velocities.stayed,
        share_paired=velocities.share_paired,
        share_alone=velocities.alone.share,
        wrong_share=velocities.wrong_share,
        mean_m_s=velocities.mean_m_s,
        separation_ns=separation.mean_ns,
        separation_source=separation.source,
    )


def _uneven(separation: Separation) -> Iterator[str]:
    if separation.spread_ns > MOST_SPREAD * separation.mean_ns:
        yield (
            f"separations of the views differ by {separation.spread_ns:g} ns, limit {100 * MOST_SPREAD:g} % of "
            f"{separation.mean_ns:g} ns: they see droplets at different times"
        )


def _against(velocities: MeasuredVelocities, axis: Sequence[float] | None) -> Iterator[str]:
    """Whether droplets fly to where the spray is stated to come from."""
    way = way_of(velocities.first.velocities_m_s[velocities.first.paired])
    if axis is None or way is None or velocities.pairs < FEWEST_PAIRS:
        return
    if way @ np.array(axis) < AGAINST * np.linalg.norm(axis):
        yield (
            f"droplets fly along {', '.join(f'{part:.1f}' for part in way)}, against the stated axis of the spray: are "
            "images upside down, or exposures A and B exchanged? Velocities have the wrong sign then"
        )


def shot_summary(
    shot: int, exposures: tuple[Exposure, ...], velocity: ShotVelocity | str, cpu_s: float, file: Path
) -> ShotDroplets:
    """What became of a shot.

    Parameters
    ----------
    shot : int
        Index of the shot.
    exposures : tuple of MeasuredExposure
        All that was measured.
    velocity : ShotVelocity | str
        What to tell of the velocities, or why there are none.
    cpu_s : float
        CPU time.
    file : Path
        Of the droplets.
    """
    share = _ghost_share(exposures)
    twins = pooled(exposure.twins for exposure in exposures if exposure.twins)
    ratios = [exposure.residual_over_noise for exposure in exposures if exposure.residual_over_noise is not None]
    verdict = max((exposure.verdict for exposure in exposures), key=list(ShotVerdict).index)
    return ShotDroplets(
        shot=shot,
        droplets=sum(len(exposure.droplets) for exposure in exposures),
        ghost_share=None if isinstance(share, str) else share.value,
        ghost_interval=None if isinstance(share, str) else (share.low, share.high),
        ghost_reason=share if isinstance(share, str) else None,
        twin_ghost_share=twins.share,
        residual_over_noise=max(ratios, default=None),
        hidden_share=max(exposure.hidden.volume_share for exposure in exposures),
        liquid_objects=sum(exposure.hidden.liquid_objects for exposure in exposures),
        verdict=verdict,
        reasons=tuple(dict.fromkeys(reason for exposure in exposures for reason in exposure.reasons)),
        cpu_s=cpu_s,
        file=file.name,
        velocity=None if isinstance(velocity, str) else velocity,
        velocity_reason=velocity if isinstance(velocity, str) else None,
    )


def _ghost_share(exposures: Sequence[Exposure]) -> Estimate | str:
    """Of the exposures together; where one does not tell, why."""
    p_real = np.concatenate([one.droplets.p_real for one in exposures])
    first = min(exposures, key=lambda one: one.beside_liquid)
    together = told_share(p_real, first.droplets.sized, len(exposures), first.untried)
    reasons = dict.fromkeys(one.ghost_share for one in exposures if isinstance(one.ghost_share, str))
    of_both = isinstance(together, str) and all(one.verdict is ShotVerdict.GOOD for one in exposures)
    return together if of_both or not reasons else "; ".join(reasons)
