"""The cone that droplets make: how far its middle is from an axis, and from where along it it widens.

*Tilt*, also where more droplets fly to one side than to another. Seen along the axis, a direction is ``theta`` degrees
away at the azimuth ``phi``. Of a cone around the axis ``theta`` is alike at every azimuth; of one that is tilted it is
``theta_0 + a cos phi + b sin phi``, and ``(a, b)`` is the tilt. The mean direction would be drawn to where most
droplets are.

*Apex*, without velocities, or where a swirl makes them tell no nozzle. Around the right nozzle the mean distance of
droplets from the axis grows in proportion to that along it. A box that cuts the spray would bend this: only those
droplets count that are within the widest cone that it holds all along.
"""

from dataclasses import dataclass

import numpy as np

from processing.analysis.estimates import Figures
from processing.analysis.spray.spray_axis import SprayAxis
from processing.analysis.spray.spray_sample import SpraySample
from processing.geometry import FloatArray

FEWEST = 100
"""Droplets, to say that a cone leans, or widens from elsewhere."""
MOST_LEAN_DEG, SURE = 1.5, 0.99
"""Of the middle of a cone from the axis: one of 23 degrees becomes one of 26."""
WIDE = 0.75
"""Spread of directions over their distance from the axis, of a cone that is around the axis."""
FIRST, LAST = 0.1, 0.9
"""Of the way on which the axis passes through a box: where the cone begins and ends that it holds all along."""


def tilt_addends(axis: SprayAxis, ways: FloatArray) -> FloatArray:
    """What directions, (N, 3) of any length, add to the equations of the tilt: (N, 9)."""
    along, first, second = axis.frame @ ways.T
    theta_deg, phi = np.degrees(np.arctan2(np.hypot(first, second), along)), np.arctan2(second, first)
    c, s = np.cos(phi), np.sin(phi)
    return np.column_stack([np.ones(len(c)), c, s, c * c, c * s, s * s, theta_deg, theta_deg * c, theta_deg * s])


def tilts_deg(sums: FloatArray) -> FloatArray:
    """Tilts towards the two directions across the axis, (rows, 2), of sums of addends, (rows, 9)."""
    known = np.isfinite(sums).all(axis=1)
    n, c, s, cc, cs, ss = sums[known, :6].T
    matrices = np.moveaxis(np.array([[n, c, s], [c, cc, cs], [s, cs, ss]]), 2, 0)
    found = np.full((len(sums), 2), np.nan)
    found[known] = np.einsum("rij,rj->ri", np.linalg.pinv(matrices, hermitian=True), sums[known, 6:])[:, 1:]
    return found


def lean_of(sample: SpraySample, ways: FloatArray, axis: SprayAxis) -> tuple[float, float] | None:
    """By how many degrees a cone leans from an axis, and within how many with 99 %; None where it may be chance.

    Parameters
    ----------
    sample : SpraySample
        Droplets.
    ways : (N, 3) array
        Their directions, of any length.
    axis : SprayAxis
        Of which only the direction counts.
    """
    if len(sample) < FEWEST:
        return None
    addends = tilt_addends(axis, ways)
    away_deg = addends[:, 7:9].mean(axis=0)
    beside = addends[:, 7:9].std(axis=0).max() < WIDE * np.linalg.norm(away_deg)

    def leans_of(drawn: SpraySample) -> Figures:
        sums = drawn.totals(addends)
        return lambda counts: _means_deg(sums(counts)) if beside else tilts_deg(sums(counts))

    told = [one for one in sample.estimated(leans_of, signed=True, confidence=SURE) if one]
    lean_deg = float(np.linalg.norm([one.value for one in told]))
    within_deg = float(np.linalg.norm([(one.high - one.low) / 2 for one in told]))
    return (lean_deg, within_deg) if len(told) == 2 and lean_deg > max(MOST_LEAN_DEG, within_deg) else None


def _means_deg(sums: FloatArray) -> FloatArray:
    """Of directions that are all to one side of the axis: tilts are where they are."""
    return np.asarray(sums[:, 7:9] / np.maximum(sums[:, :1], 1))


@dataclass(frozen=True)
class Apex:
    """Where a spray begins along the axis, from the stated nozzle; within how much; and how far its droplets are."""

    off_mm: float
    within_mm: float
    far_mm: float


def apex_mm(sample: SpraySample, axis: SprayAxis) -> Apex | None:
    """From where a spray widens; None where too few droplets tell, or it does not.

    Parameters
    ----------
    sample : SpraySample
        Droplets, with or without velocities.
    axis : SprayAxis
        As stated.
    """
    ends_mm = None if sample.box_mm is None else _ends_mm(axis, sample.box_mm)
    if ends_mm is None or sample.box_mm is None:
        return None
    along_mm, from_mm, _ = axis.coordinates(sample.points_mm)
    slope = np.min(_around_mm(axis, sample.box_mm, ends_mm) / ends_mm)
    within = (along_mm > ends_mm[0]) & (along_mm < ends_mm[1]) & (from_mm < slope * along_mm)
    return _fitted(sample.chosen(within), along_mm[within], from_mm[within]) if within.sum() >= FEWEST else None


def _fitted(cone: SpraySample, along_mm: FloatArray, from_mm: FloatArray) -> Apex | None:
    """Where a line through the distances from the axis reaches it."""
    far_mm = float(along_mm.mean())
    columns = np.column_stack([np.ones(len(cone)), along_mm, from_mm, along_mm**2, along_mm * from_mm])

    def apex_of(drawn: SpraySample) -> Figures:
        sums = drawn.totals(columns)
        return lambda counts: _crossed_mm(sums(counts))

    (told,) = cone.estimated(apex_of, signed=True, confidence=SURE)
    return Apex(told.value, (told.high - told.low) / 2, far_mm) if told else None


def _crossed_mm(sums: FloatArray) -> FloatArray:
    """Of sums of 1, x, y, x x, x y: where a line through (x, y) is zero, (rows, 1)."""
    n, x, y, xx, xy = sums.T
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray((xx * y - x * xy) / (x * y - n * xy))[:, None]


def _ends_mm(axis: SprayAxis, box_mm: FloatArray) -> FloatArray | None:
    """Between which distances from the nozzle the axis is well within a box; None where it passes beside it."""
    with np.errstate(divide="ignore", invalid="ignore"):
        crossed_mm = np.sort((box_mm - np.array(axis.nozzle_mm)) / axis.frame[0], axis=0)
    enters_mm, leaves_mm = max(0.0, float(np.nanmax(crossed_mm[0]))), float(np.nanmin(crossed_mm[1]))
    return enters_mm + (leaves_mm - enters_mm) * np.array([FIRST, LAST]) if leaves_mm > enters_mm else None


def _around_mm(axis: SprayAxis, box_mm: FloatArray, along_mm: FloatArray) -> FloatArray:
    """How far around places on the axis a box reaches, perpendicular to it: one each."""
    places_mm = np.array(axis.nozzle_mm) + along_mm[:, None] * axis.frame[0]
    depth_mm = np.minimum(places_mm - box_mm[0], box_mm[1] - places_mm)
    across = np.sqrt(np.maximum(1 - axis.frame[0] ** 2, np.finfo(float).tiny))
    return np.asarray((depth_mm / across).min(axis=1))
