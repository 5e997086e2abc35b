"""What makes the figures of a spray doubtful: verdicts on its exposures and velocities, and what contradicts the axis.

A figure is no better than the shots that it comes from. Each of these is told beside the figures, wherever they go.
"""

import json
from collections.abc import Iterator, Sequence

import numpy as np

from processing.analysis.copied_shots import copies_told
from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.few_together import few_together
from processing.analysis.lingering_droplets import lingering_told
from processing.analysis.near_or_far import depth_doubts
from processing.analysis.shot_doubts import exposure_doubts, velocity_doubts
from processing.analysis.spray.spray_axis import SprayAxis
from processing.analysis.spray.spray_motion import FEWEST, all_alike
from processing.analysis.spray.spray_sample import SpraySample
from processing.analysis.velocity.velocity_verdict import FASTEST_M_S
from processing.geometry import FloatArray

NO_CONDITIONS = ("operator", "remark", "more")
"""Of the notes, what may differ in one spray; what is in ``more`` is looked at by its own names."""
NOT_STATED = "not stated"
MOST_ASIDE_DEG = 45.0
"""Of the mean velocity from the axis; a spray flies along its axis, however wide it is."""
MOST_BEHIND = 0.05
"""Of the droplets; some are carried back."""
FARTHEST_MM = 2000.0
"""From the nozzle: no spray that is measured droplet by droplet is as long."""
MOST_OFF_WAY_DEG = 15.0
"""Of the mean flight from the mean way that leads from the nozzle to the droplets; single ones may fly anywhere."""
MOST_ON_ONE_SIDE = 0.98
"""Of the droplets, of an axis around which the box reaches."""
LEAST_TOGETHER = 0.3
"""Amount of the mean velocity over the mean speed: droplets that fly in all directions have none."""


def spray_doubts(
    shots: Sequence[StoredDroplets], sample: SpraySample | None, axis: SprayAxis | None
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
    """
    return (
        *exposure_doubts(shots),
        *few_together(shots),
        *velocity_doubts(shots),
        *copies_told(shots),
        *lingering_told(shots),
        *depth_doubts(shots),
        *_of_conditions(shots),
        *(_of_equals(sample) if sample else ()),
        *(_of_motion(sample, axis) if sample else ()),
        *(_of_nozzle(sample, axis) if sample and axis and len(sample) else ()),
    )


def noted(shots: Sequence[StoredDroplets]) -> dict[str, str]:
    """What the operator has written down of some shots, by name; several values where shots differ."""
    notes = [json.loads(str(shot.provenance.get("notes", "{}"))) for shot in shots]
    stated = [{**one, **one.get("more", {})} for one in notes]
    names = dict.fromkeys(name for one in stated for name in one if name not in NO_CONDITIONS)
    return {name: " and ".join(dict.fromkeys(str(one.get(name, NOT_STATED)) for one in stated)) for name in names}


def _of_conditions(shots: Sequence[StoredDroplets]) -> Iterator[str]:
    """What is not the same of all shots."""
    alike = noted(shots[:1])
    for name, values in noted(shots).items():
        if values != alike.get(name, NOT_STATED):
            yield f"shots differ in {name}: {values}; they are no one spray"


def _of_nozzle(sample: SpraySample, axis: SprayAxis) -> Iterator[str]:
    """What contradicts its place."""
    along_mm, from_mm, azimuth_deg = axis.coordinates(sample.points_mm)
    if (share := float(np.mean(along_mm < 0))) > MOST_BEHIND:
        yield f"{100 * share:.0f} % of the droplets lie behind the nozzle: is it stated rightly, and the axis?"
        return
    if (away_mm := float(np.median(along_mm))) > FARTHEST_MM:
        yield f"the nozzle is stated {away_mm:.3g} mm from the droplets: is its place in mm? Angles are seen from there"
        return
    if (off_way_deg := _off_way_deg(sample, axis)) > MOST_OFF_WAY_DEG:
        yield (
            f"droplets fly {off_way_deg:.0f} degrees aside of the way from the nozzle, in the mean: is its place "
            "stated rightly? Figures across the axis are of another place"
        )
    elif sample.box_mm is not None and np.percentile(from_mm, 5) > np.linalg.norm(np.ptp(sample.box_mm, axis=0)):
        yield (
            f"the axis passes {np.percentile(from_mm, 5):.2g} mm beside the droplets, farther than the box is wide: is "
            "the place of the nozzle stated rightly?"
        )
    elif sample.box_mm is not None and _on_one_side(from_mm, azimuth_deg, _inside_mm(axis, sample.box_mm)):
        yield (
            f"the droplets lie on one side of the axis, {np.median(from_mm):.2g} mm from it, and the box reaches "
            "around it: is the place of the nozzle stated rightly?"
        )


def _off_way_deg(sample: SpraySample, axis: SprayAxis) -> float:
    """Angle between the mean direction of flight and the mean way from the nozzle; 0 where nothing flies together."""
    paired = sample.paired
    velocities, ways = sample.velocities_m_s[paired], sample.points_mm[paired] - np.array(axis.nozzle_mm)
    speeds, lengths = np.linalg.norm(velocities, axis=1), np.linalg.norm(ways, axis=1)
    moving = (speeds > 0) & (lengths > 0)
    if not moving.any():
        return 0.0
    flight = (velocities[moving] / speeds[moving, None]).mean(axis=0)
    way = (ways[moving] / lengths[moving, None]).mean(axis=0)
    together = np.linalg.norm(flight)
    if together <= LEAST_TOGETHER or (way @ flight) <= 0:  # that it flies another way is told of the axis
        return 0.0
    return float(np.degrees(np.arccos(np.clip(flight @ way / (together * np.linalg.norm(way)), -1, 1))))


def _inside_mm(axis: SprayAxis, box_mm: FloatArray) -> float:
    """How far around the axis a box reaches, where it reaches farthest; 0 where the axis does not pass through it."""
    along_mm = np.linspace(*axis.reach_mm(box_mm), 200)
    places_mm = np.array(axis.nozzle_mm) + along_mm[:, None] * axis.frame[0]
    across = np.abs(axis.frame[0]) < np.sqrt(0.5)  # the axis leaves the box by the other faces
    depth_mm = np.minimum(places_mm - box_mm[0], box_mm[1] - places_mm)
    inside = (depth_mm >= 0).all(axis=1)
    return float(depth_mm[inside][:, across].min(axis=1).max()) if inside.any() else 0.0


def _on_one_side(from_mm: FloatArray, azimuth_deg: FloatArray, around_mm: float) -> bool:
    """Whether the droplets lie beside an axis, nearer to it than the box reaches on their other side."""
    angle = np.radians(azimuth_deg)
    unit = np.column_stack([np.cos(angle), np.sin(angle)])
    side = unit @ unit.mean(axis=0) > 0
    width_mm = float(np.sqrt((from_mm[:, None] * unit).var(axis=0).sum()))
    return float(np.mean(side)) > MOST_ON_ONE_SIDE and float(np.percentile(from_mm, 5)) > width_mm < 3 * around_mm


def _of_equals(sample: SpraySample) -> Iterator[str]:
    """What no measurement gives: numbers without any scatter, whose intervals have no width."""
    if len(sample) < FEWEST:
        return
    if all_alike(sample.diameters_um):
        yield f"all {len(sample)} diameters are the very same: nothing is measured so; intervals of sizes have no width"
    velocities_m_s = sample.velocities_m_s[sample.paired]
    if len(velocities_m_s) >= FEWEST and all(map(all_alike, velocities_m_s.T)):
        yield f"all {len(velocities_m_s)} velocities are the very same: nothing is measured so; intervals have no width"


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
