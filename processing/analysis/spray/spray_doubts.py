"""What makes the figures of a spray doubtful: verdicts on its exposures and velocities, and what contradicts the axis.

A figure is no better than the shots that it comes from. Each of these is told beside the figures, wherever they go.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from processing.analysis.copied_shots import copies_told
from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.droplets.droplet_statistics import measured_grid
from processing.analysis.estimates import Figures
from processing.analysis.few_together import few_together
from processing.analysis.lingering_droplets import lingering_told
from processing.analysis.near_or_far import depth_doubts
from processing.analysis.shot_doubts import exposure_doubts, velocity_doubts
from processing.analysis.spray.axis_doubts import LEAST_TOGETHER, axis_doubts
from processing.analysis.spray.proposed_axis import ProposedAxis
from processing.analysis.spray.spray_axis import SprayAxis
from processing.analysis.spray.spray_motion import FEWEST, all_alike
from processing.analysis.spray.spray_sample import SpraySample, box_told
from processing.analysis.spray.steadiness import changes_of_spray
from processing.analysis.stored_json import stored_json
from processing.analysis.unlike_numbers import unlike_shots
from processing.analysis.velocity.velocity_verdict import FASTEST_M_S
from processing.geometry import FloatArray

NO_CONDITIONS = ("operator", "remark", "more")
"""Of the notes, what may differ in one spray; what is in ``more`` is looked at by its own names."""
NOT_STATED = "not stated"
LIGHTEST_KG_M3, PA_PER_BAR = 600.0, 1e5
"""Of what is liquid at room temperature: it leaves a nozzle the fastest."""
SIZES, FEWEST_OF_SIZES = 8, 100
"""Classes of diameters, of equal numbers; droplets with a velocity."""
MOST_BY_SIZES, MOST_BY_VOLUME, SURE = 0.02, 0.03, 0.99
"""Of the mean speed by number, and by volume: of the flux."""
MOST_ASIDE_DEG = 45.0
"""Of the mean velocity from the axis; a spray flies along its axis, however wide it is."""


def spray_doubts(
    shots: Sequence[StoredDroplets],
    sample: SpraySample | None = None,
    axis: SprayAxis | None = None,
    proposed: ProposedAxis | None = None,
) -> tuple[str, ...]:
    """What is doubtful, and what to do.

    Parameters
    ----------
    shots : sequence of StoredDroplets
        All of them, refused ones too.
    sample : SpraySample | None
        Their droplets; None where they have no diameters.
    axis : SprayAxis | None
        As stated.
    proposed : ProposedAxis | None
        What the droplets say of it.
    """
    lingering = lingering_told(shots)
    return (
        *exposure_doubts(shots),
        *few_together(shots),
        *([unlike] if (unlike := unlike_shots(shots)) else []),
        *velocity_doubts(shots),
        *copies_told(shots),
        *lingering,
        *depth_doubts(shots),
        *_of_conditions(shots),
        *_of_boxes(shots),
        *(_of_equals(sample) if sample else ()),
        *(_of_changes(sample, axis, proposed) if sample and not lingering else ()),
        *(_of_motion(sample, axis) if sample else ()),
        *(_of_unpaired(sample) if sample else ()),
        *(_of_pressure(shots, sample) if sample else ()),
        *(axis_doubts(sample, axis, proposed) if sample and len(sample) else ()),
    )


def noted(shots: Sequence[StoredDroplets]) -> dict[str, str]:
    """What the operator has written down of some shots, by name; several values where shots differ."""
    notes = [stored_json(shot.provenance, "notes") for shot in shots]
    stated = [{**one, **one.get("more", {})} for one in notes]
    names = dict.fromkeys(name for one in stated for name in one if name not in NO_CONDITIONS)
    return {name: " and ".join(dict.fromkeys(str(one.get(name, NOT_STATED)) for one in stated)) for name in names}


def _of_conditions(shots: Sequence[StoredDroplets]) -> Iterator[str]:
    """What is not the same of all shots."""
    alike = noted(shots[:1])
    for name, values in noted(shots).items():
        if values != alike.get(name, NOT_STATED):
            yield f"shots differ in {name}: {values}; they are no one spray"


def _of_boxes(shots: Sequence[StoredDroplets]) -> Iterator[str]:
    """Where shots were measured, if not in one box."""
    boxes = list(dict.fromkeys(box_told(grid) for shot in shots if (grid := measured_grid(shot))))
    if len(boxes) > 1:
        yield (
            f"shots were measured in {len(boxes)} boxes ({boxes[0]}; {boxes[1]}): densities, flux and sizes are means "
            "over both places; measure all of them in one"
        )


def _of_equals(sample: SpraySample) -> Iterator[str]:
    """What no measurement gives: numbers without any scatter, whose intervals have no width."""
    if len(sample) < FEWEST:
        return
    if all_alike(sample.diameters_um):
        yield f"all {len(sample)} diameters are the very same: nothing is measured so; intervals of sizes have no width"
    velocities_m_s = sample.velocities_m_s[sample.paired]
    if len(velocities_m_s) >= FEWEST and all(map(all_alike, velocities_m_s.T)):
        yield f"all {len(velocities_m_s)} velocities are the very same: nothing is measured so; intervals have no width"


def _of_changes(sample: SpraySample, axis: SprayAxis | None, proposed: ProposedAxis | None) -> tuple[str, ...]:
    """Of shots that are samples of their own: those that show the same droplets differ less than samples do."""
    return changes_of_spray(sample, axis or (proposed.believed if proposed else None)) if len(sample) else ()


def _of_motion(sample: SpraySample, axis: SprayAxis | None) -> Iterator[str]:
    velocities_m_s = sample.velocities_m_s[sample.paired]
    if not len(velocities_m_s):
        return
    mean_m_s, speed_m_s = velocities_m_s.mean(axis=0), np.linalg.norm(velocities_m_s, axis=1).mean()
    amount_m_s = np.linalg.norm(mean_m_s)
    if speed_m_s > FASTEST_M_S:
        yield f"mean speed {speed_m_s:.3g} m/s: no spray is as fast; is the separation stated rightly, in ns?"
    if axis is None or amount_m_s <= LEAST_TOGETHER * speed_m_s:
        return
    aside_deg = np.degrees(np.arccos(np.clip(axis.frame[0] @ mean_m_s / amount_m_s, -1, 1)))
    if aside_deg > MOST_ASIDE_DEG:
        yield (
            f"droplets fly {aside_deg:.0f} degrees from the axis, in the mean: is it stated rightly, and are exposures "
            "A and B exchanged? Figures along the axis are of another direction"
        )


def _of_unpaired(sample: SpraySample) -> Iterator[str]:
    """Whether droplets without a velocity are of other sizes, which fly faster or slower, than those that have one."""
    paired = sample.paired
    if np.count_nonzero(paired) < FEWEST_OF_SIZES or paired.all():
        return
    by_number, by_volume = np.ones(len(sample)), sample.cubes_um3
    if (ratio := _if_alike(sample, by_number, MOST_BY_SIZES)) is not None:
        mean_m_s = float(np.linalg.norm(sample.velocities_m_s[paired], axis=1).mean())
        yield (
            f"{100 * np.mean(~paired):.0f} % of the droplets have no velocity, and are of other sizes than those that "
            f"have one: the mean speed is {mean_m_s:.3g} m/s of these, but {ratio * mean_m_s:.3g} m/s if all of "
            "a size fly alike; mean velocities and flux are of those that have one"
        )
    elif (ratio := _if_alike(sample, by_volume, MOST_BY_VOLUME)) is not None:
        yield (
            f"droplets with {100 * by_volume[~paired].sum() / by_volume.sum():.0f} % of the liquid have no "
            "velocity, and are of other sizes than those that have one: flux is wrong by a factor of "
            f"{ratio:.2f}, or by more where none of the largest has one, and flux-weighted diameters lack them"
        )


def _if_alike(sample: SpraySample, weights: FloatArray, most: float) -> float | None:
    """Mean speed by weight of all droplets, if those of a size fly alike, over that of those with a velocity.

    None where it is 1, but for so much, or for chance.
    """
    paired = sample.paired
    speeds_m_s = np.where(paired, np.linalg.norm(np.nan_to_num(sample.velocities_m_s), axis=1), 0.0)
    order = np.argsort(sample.diameters_um, kind="stable")
    before = np.empty(len(order))
    before[order] = np.cumsum(weights[order]) - weights[order]
    of_class = weights[:, None] * np.eye(SIZES)[np.minimum((before * SIZES / weights.sum()).astype(int), SIZES - 1)]
    columns = np.hstack([of_class, of_class * paired[:, None], of_class * speeds_m_s[:, None]])

    def ratio_of(drawn: SpraySample) -> Figures:
        sums = drawn.totals(columns)
        return lambda counts: _by_all_sizes(sums(counts))

    (ratio,) = sample.estimated(ratio_of, signed=True, confidence=SURE)
    is_sure = ratio and abs(ratio.value - 1) > most and not ratio.low <= 1 <= ratio.high
    return ratio.value if ratio and is_sure else None


def _by_all_sizes(sums: FloatArray) -> FloatArray:
    """Mean speed of all, if those of a size fly alike, over that of those with a velocity, (rows, 1)."""
    n, paired, speeds = np.split(sums, 3, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        by_size = (n * _as_next_to(speeds / paired)).sum(axis=1) / n.sum(axis=1)
        return np.asarray(by_size * paired.sum(axis=1) / speeds.sum(axis=1))[:, None]


def _as_next_to(means: FloatArray) -> FloatArray:
    """Of sizes without any, (rows, sizes), those of the next smaller one that has some, or of the next larger one."""
    filled = means.copy()
    for size, other in (*pairwise(range(SIZES)), *pairwise(reversed(range(SIZES)))):
        filled[:, other] = np.where(np.isnan(filled[:, other]), filled[:, size], filled[:, other])
    return filled


def _of_pressure(shots: Sequence[StoredDroplets], sample: SpraySample) -> Iterator[str]:
    """Whether droplets fly faster than the pressure that is noted makes any liquid leave a nozzle (Bernoulli)."""
    notes = [stored_json(shot.provenance, "notes") for shot in shots]
    stated_bar = [one.get("pressure_bar") for one in notes]
    speeds_m_s = np.linalg.norm(sample.velocities_m_s[sample.paired], axis=1)
    if None in stated_bar or not max(stated_bar, default=0) or len(speeds_m_s) < FEWEST:
        return
    fastest_m_s = np.sqrt(2 * PA_PER_BAR * max(stated_bar) / LIGHTEST_KG_M3)
    if (speed_m_s := float(np.median(speeds_m_s))) > fastest_m_s:
        yield (
            f"droplets fly at {speed_m_s:.3g} m/s, but {max(stated_bar):g} bar make no liquid faster than "
            f"{fastest_m_s:.3g} m/s, if no gas drives it: is the separation stated rightly, in ns, and the pressure?"
        )
