"""What contradicts nozzle and axis as somebody has stated them: where droplets are, and how they fly."""

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from processing.analysis.estimates import Figures
from processing.analysis.spray.cone import MOST_LEAN_DEG, SURE, apex_mm, lean_of
from processing.analysis.spray.proposed_axis import MOST_BEHIND, SURER, ProposedAxis
from processing.analysis.spray.spray_axis import SprayAxis
from processing.analysis.spray.spray_sample import SpraySample
from processing.geometry import FloatArray

FARTHEST_MM = 2000.0
"""From the nozzle: no spray that is measured droplet by droplet is as long."""
MOST_OFF_WAY_DEG = 15.0
"""Of the mean flight from the mean way that leads from the nozzle to the droplets; single ones may fly anywhere."""
MOST_ON_ONE_SIDE = 0.98
"""Of the droplets, of an axis around which the box reaches."""
LEAST_TOGETHER = 0.3
"""Amount of the mean velocity over the mean speed: droplets that fly in all directions have none."""
FEWEST = 100
"""Droplets with a velocity, to say that they come from two places."""
MOST_NEARER = 0.1
"""Of the distance from the nozzle to the droplets: so much nearer or farther it may be; angles change as much."""
MOST_LONGER, TWO_HEAPED, WILD = 2.0, 1.7, 3.5
"""Of where droplets come from: length over width, and the kurtosis of its length, less scatter, and its whole interval:
two places have 1, three 1.5, a slit 1.8, one place 3. Beyond 3.5 medians are wrong partners."""
RING = 16
"""Places around the axis that must all be in the box."""


def axis_doubts(sample: SpraySample, axis: SprayAxis | None, proposed: ProposedAxis | None) -> tuple[str, ...]:
    """Say what contradicts a stated axis; where none is, that droplets of two nozzles have no common one.

    Parameters
    ----------
    sample : SpraySample
        The droplets, one at least.
    axis : SprayAxis | None
        As stated.
    proposed : ProposedAxis | None
        What the droplets say by themselves.
    """
    if axis is None:
        return tuple(_of_two_places(sample, proposed.believed)) if proposed and proposed.believed else ()
    coarse = tuple(_of_places(sample, axis))
    if coarse:
        return coarse
    told = (*_of_lean(sample, axis, proposed), *_of_meeting(sample, axis, proposed))
    return told or tuple(_of_two_places(sample, axis))


def _of_lean(sample: SpraySample, axis: SprayAxis, proposed: ProposedAxis | None) -> Iterator[str]:
    """Whether the middle of the spray is beside the axis: of its flight, or of where it is as the nozzle sees it."""
    held = sample.chosen(_held_all_around(sample, axis))
    flying = held.flying
    said = f": {proposed.words}" if proposed else ""
    remedy = f"State both with --nozzle and --axis, or in the run's notes{said}"
    if lean := lean_of(flying, flying.velocities_m_s, axis) or _from_proposed(axis, proposed):
        stated = _numbers(axis.direction)
        yield f"droplets fly around an axis that is {_told(*lean)} beside the stated one, {stated}. {remedy}"
    elif lean := lean_of(held, held.points_mm - np.array(axis.nozzle_mm), axis):
        yield (
            f"droplets lie {_told(*lean)} beside the axis, seen from the stated nozzle, {_numbers(axis.nozzle_mm)} mm: "
            f"is its place stated rightly, and the axis? {remedy}"
        )


def _from_proposed(axis: SprayAxis, proposed: ProposedAxis | None) -> tuple[float, float] | None:
    """How far a proposed axis is from the stated one; of a fan, which has no directions all around, only that tells."""
    if proposed is None or proposed.axis is None or proposed.axis_within_deg is None:
        return None
    cosine = float(axis.frame[0] @ np.array(proposed.axis))
    off_deg, within_deg = float(np.degrees(np.arccos(np.clip(cosine, -1, 1)))), SURER * proposed.axis_within_deg
    return (off_deg, within_deg) if off_deg > MOST_LEAN_DEG + within_deg else None


def _told(lean_deg: float, within_deg: float) -> str:
    return f"{lean_deg:.1f} degrees (99 %: within {within_deg:.1f})"


def _held_all_around(sample: SpraySample, axis: SprayAxis) -> NDArray[np.bool_]:
    """Droplets that a box would hold at every azimuth: those of a spray around the axis have their middle on it."""
    if sample.box_mm is None:
        return np.zeros(len(sample), np.bool_)  # nobody knows what a box cuts off
    along_mm, from_mm, _ = axis.coordinates(sample.points_mm)
    held = along_mm > 0
    for angle in 2 * np.pi * np.arange(RING) / RING:
        across = np.cos(angle) * axis.frame[1] + np.sin(angle) * axis.frame[2]
        places_mm = axis.nozzle_mm + along_mm[:, None] * axis.frame[0] + from_mm[:, None] * across
        held &= ((places_mm >= sample.box_mm[0]) & (places_mm <= sample.box_mm[1])).all(axis=1)
    return np.asarray(held)


def _of_meeting(sample: SpraySample, axis: SprayAxis, proposed: ProposedAxis | None) -> Iterator[str]:
    """Whether droplets fly away from another place."""
    if proposed is None or proposed.nozzle_mm is None:
        yield from _of_widening(sample, axis)
        return
    place_mm = np.array([one.value for one in proposed.nozzle_mm])
    unsure_mm = np.array([(one.high - one.low) / 2 for one in proposed.nozzle_mm])
    far_mm = abs(float(axis.frame[0] @ (sample.points_mm.mean(axis=0) - place_mm)))
    off_mm = axis.frame @ (place_mm - np.array(axis.nozzle_mm))
    least_mm = far_mm * np.array([MOST_NEARER, *[np.tan(np.radians(MOST_LEAN_DEG))] * 2])
    if (np.abs(off_mm) > least_mm + SURER * np.abs(axis.frame) @ unsure_mm).any():
        yield (
            f"the lines along which droplets fly meet {np.linalg.norm(off_mm):.2g} mm from the stated nozzle, "
            f"{_numbers(axis.nozzle_mm)} mm, at {_numbers(place_mm)}: is its place stated rightly? Angles are seen "
            f"from there; {proposed.words}"
        )


def _of_widening(sample: SpraySample, axis: SprayAxis) -> Iterator[str]:
    """Whether a spray whose flights tell no nozzle widens from another place."""
    apex = apex_mm(sample, axis)
    if apex and abs(apex.off_mm) > MOST_NEARER * apex.far_mm + apex.within_mm:
        where = "beyond" if apex.off_mm > 0 else "before"
        yield (
            f"seen from the side, the spray widens from {abs(apex.off_mm):.2g} mm {where} the stated nozzle, "
            f"{_numbers(axis.nozzle_mm)} mm (99 %: within {apex.within_mm:.2g}): is its place stated rightly, or does "
            "the spray bend? Angles are seen from there"
        )


def _of_two_places(sample: SpraySample, axis: SprayAxis) -> Iterator[str]:
    """Whether droplets come from two nozzles or more in a row, and next to none from between them."""
    flying = sample.flying
    if len(flying) < FEWEST:
        return
    crossed_mm = axis.crossings_mm(flying.points_mm, flying.velocities_m_s)
    off_mm = np.linalg.norm(crossed_mm - np.median(crossed_mm, axis=0), axis=1)
    near = off_mm <= WILD * np.median(off_mm)
    if apart_mm := _two_heaps_mm(flying.chosen(near), crossed_mm[near]):
        yield (
            f"droplets come from places {apart_mm:.2g} mm apart, on both sides of the nozzle: are they "
            "of two sprays? Angles and shares are of none of them; measure a box around each"
        )


def _two_heaps_mm(flying: SpraySample, crossed_mm: FloatArray) -> float | None:
    """How far apart two heaps in a row are; None where there are none. Across the row there is scatter alone."""
    (across_mm2, along_mm2), directions = np.linalg.eigh(np.cov(crossed_mm.T))
    own_mm2 = along_mm2 - across_mm2
    if along_mm2 <= MOST_LONGER**2 * across_mm2:
        return None
    row_mm = (crossed_mm - crossed_mm.mean(axis=0)) @ directions[:, 1]
    columns = np.column_stack([row_mm**4, row_mm**2, np.ones(len(row_mm))])

    def kurtosis_of(drawn: SpraySample) -> Figures:
        sums = drawn.totals(columns)
        return lambda counts: _kurtosis(sums(counts), own_mm2)

    (told,) = flying.estimated(kurtosis_of, signed=True, confidence=SURE)
    return 2 * float(np.sqrt(own_mm2)) if told and told.high < TWO_HEAPED else None


def _kurtosis(sums: FloatArray, own_mm2: float) -> FloatArray:
    """Of places, (rows, 1), of sums of x^4, x^2, 1; normal scatter adds to both, and to neither of this difference."""
    fourth, second = (sums[:, :2] / np.maximum(sums[:, 2:], 1)).T
    return np.asarray(3 + (fourth - 3 * second**2) / own_mm2**2)[:, None]


def _numbers(values: Iterable[float]) -> str:
    return ",".join(f"{round(one, 2) + 0.0:g}" for one in values)


def _of_places(sample: SpraySample, axis: SprayAxis) -> Iterator[str]:
    """What contradicts the place of the nozzle."""
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
