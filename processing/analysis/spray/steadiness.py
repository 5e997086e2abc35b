"""Whether a spray stays what it is over its shots: else its means are of no one spray, and their intervals of nothing.

In the order in which they were taken, shots are split in two wherever the parts differ most, and a straight line is
laid through them: ``t`` is a difference, or a slope, over its standard error, as shots scatter beside it. How large
chance makes the largest ``t`` of so many shots of one spray is drawn from normal numbers (a change at a place that
nobody knows: Hawkins, Testing a sequence of observations for a shift in location, JASA 72, 1977). Many shots are taken
in groups.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from processing.analysis.estimates import SEED
from processing.analysis.spray.cone_tilt import tilt_addends, tilts_deg
from processing.analysis.spray.spray_axis import SprayAxis, direction_name
from processing.analysis.spray.spray_sample import SpraySample
from processing.geometry import FloatArray

FEWEST, MOST = 4, 30
"""Shots, and groups of them; each part has two at least."""
FEWEST_DROPLETS = 5
"""Of a group."""
CHANCE, DRAWS = 0.001, 10_000
"""How often chance makes as much of one of some ten figures: one of a hundred sprays."""
LEAST_RATIO, LEAST_RATIO_NUMBER = 1.05, 1.1
"""Of what matters, whatever chance does: of D32, speed and angles; of the number of droplets."""
LEAST_TURN_DEG = 1.5
"""Of the direction, and of the nozzle as droplets see it."""
LEAST_SHIFT = 0.1
"""Of how widely droplets lie along x, y or z: standard deviations."""
REMEDY = "means over them are of no one spray, and intervals do not know it: take those apart that belong together"


@dataclass(frozen=True)
class _Change:
    """Where a figure changes: shots before, and the means of both parts."""

    shots: int
    before: float
    after: float


def changes_of_spray(sample: SpraySample, axis: SprayAxis | None = None) -> tuple[str, ...]:
    """Say what of a spray changes from its first shots to its last ones.

    Parameters
    ----------
    sample : SpraySample
        Its shots in the order in which they were taken.
    axis : SprayAxis | None
        As stated or proposed; without it a nozzle that moves is told by the places of the droplets alone.
    """
    shots = len(sample.volumes_mm3)
    if shots < FEWEST:
        return ()
    groups = np.arange(shots) // -(-shots // MOST)
    told = [*_of_numbers(sample, groups), *_of_flight(sample, axis, groups)]
    told += _of_places(sample, groups)
    return (f"the spray changes over its shots: {'; '.join(told)}: {REMEDY}",) if told else ()


def _of_numbers(sample: SpraySample, groups: NDArray[np.intp]) -> Iterator[str]:
    """Droplets per volume, and their mean diameters: D10 knows a change sooner than D32."""
    with np.errstate(invalid="ignore"):
        per_mm3 = np.bincount(groups[sample.shot], minlength=groups[-1] + 1) / np.bincount(groups, sample.volumes_mm3)
    yield from _ratio_told("droplets per mm3 are {}", per_mm3, LEAST_RATIO_NUMBER, groups)
    d_um = sample.diameters_um
    number, length, area, volume = _sums(d_um[:, None] ** np.arange(4), sample, groups).T
    yield from _ratio_told("D10 is {} um", length / number, LEAST_RATIO, groups)
    yield from _ratio_told("D32 is {} um", volume / area, LEAST_RATIO, groups)


def _of_flight(sample: SpraySample, axis: SprayAxis | None, groups: NDArray[np.intp]) -> Iterator[str]:
    """Speed, direction, how far from it droplets fly, and where they come from."""
    flying = sample.chosen(sample.paired & (np.abs(sample.velocities_m_s) > 0).any(axis=1))
    if not len(flying):
        return
    speeds_m_s = np.linalg.norm(flying.velocities_m_s, axis=1)
    ways = flying.velocities_m_s / speeds_m_s[:, None]
    main = SprayAxis((0, 0, 0), tuple((ways.mean(axis=0) if axis is None else axis.frame[0]).tolist()))
    from_deg = np.degrees(np.arccos(np.clip(ways @ main.frame[0], -1, 1)))
    speed_m_s, cone_deg = _means(np.column_stack([speeds_m_s, from_deg]), flying, groups).T
    yield from _ratio_told("speed is {} m/s", speed_m_s, LEAST_RATIO, groups)
    yield from _ratio_told("droplets fly {} degrees from their axis", cone_deg, LEAST_RATIO, groups)
    across = [direction_name(one) for one in main.frame[1:]]
    turns_deg = tilts_deg(_sums(tilt_addends(main, ways), flying, groups)).T
    for name, one_deg in zip(across, turns_deg, strict=True):
        yield from _shift_told(f"their axis leans to {name} by {{}} degrees", one_deg, LEAST_TURN_DEG, groups)
    if axis is None:
        return
    far_mm = float(axis.coordinates(flying.points_mm)[0].mean())
    for name, crossed_mm in zip(
        across, _means(axis.crossings_mm(flying.points_mm, ways), flying, groups).T, strict=True
    ):
        least_mm = np.tan(np.radians(LEAST_TURN_DEG)) * far_mm
        yield from _shift_told(f"they come from {{}} mm along {name} from the nozzle", crossed_mm, least_mm, groups)


def _of_places(sample: SpraySample, groups: NDArray[np.intp]) -> Iterator[str]:
    """Where droplets lie in the mean."""
    for name, places_mm in zip("xyz", _means(sample.points_mm, sample, groups).T, strict=True):
        least_mm = LEAST_SHIFT * float(sample.points_mm[:, "xyz".index(name)].std())
        yield from _shift_told(f"in the mean droplets lie at {name} = {{}} mm", places_mm, least_mm, groups)


def _sums(values: FloatArray, sample: SpraySample, groups: NDArray[np.intp]) -> FloatArray:
    """Of values of the droplets, (N, k), by groups: (groups, k); not a number where a group has too few of them."""
    group, count = groups[sample.shot], groups[-1] + 1
    sums = np.column_stack([np.bincount(group, column, count) for column in values.T])
    few = np.bincount(group, minlength=count) < FEWEST_DROPLETS
    return np.where(few[:, None], np.nan, sums)


def _means(values: FloatArray, sample: SpraySample, groups: NDArray[np.intp]) -> FloatArray:
    sums = _sums(np.column_stack([values, np.ones(len(values))]), sample, groups)
    return np.asarray(sums[:, :-1] / sums[:, -1:])


def _ratio_told(text: str, values: FloatArray, least: float, groups: NDArray[np.intp]) -> Iterator[str]:
    change = _change(values, groups)
    if change and not 1 / least < change.after / change.before < least:
        yield _parts(text, change, groups)


def _shift_told(text: str, values: FloatArray, least: float, groups: NDArray[np.intp]) -> Iterator[str]:
    change = _change(values, groups)
    if change and abs(change.after - change.before) > least:
        yield _parts(text, change, groups)


def _parts(text: str, change: _Change, groups: NDArray[np.intp]) -> str:
    later = len(groups) - change.shots
    return (
        f"{text.format(f'{change.before:.3g}')} in the first {change.shots} shots, {change.after:.3g} in {later} later"
    )


def _change(values: FloatArray, groups: NDArray[np.intp]) -> _Change | None:
    """Where values of successive groups change, if chance does not explain it."""
    known = np.flatnonzero(np.isfinite(values))
    if len(known) < FEWEST or np.ptp(values[known]) == 0:
        return None
    t = _contrasts(values[known][None])[0]
    if t.max() <= _by_chance(len(known)):
        return None
    split = 2 + int(np.argmax(t[:-1]))
    before, after = known[:split], known[split:]
    shots = int(np.searchsorted(groups, after[0]))
    return _Change(shots, float(values[before].mean()), float(values[after].mean()))


def _contrasts(rows: FloatArray) -> FloatArray:
    """Amount of ``t`` of every split, each part of two values at least, and of a straight line: (rows, n - 2)."""
    n = rows.shape[1]
    after = (np.arange(n) >= np.arange(2, n - 1)[:, None]).astype(np.float64)
    patterns = np.vstack([after, np.arange(n)])
    patterns -= patterns.mean(axis=1, keepdims=True)
    patterns /= np.linalg.norm(patterns, axis=1, keepdims=True)
    centred = rows - rows.mean(axis=1, keepdims=True)
    between = (centred @ patterns.T) ** 2
    within = np.maximum(np.sum(centred**2, axis=1, keepdims=True) - between, np.finfo(float).tiny)
    return np.asarray(np.sqrt(between * (n - 2) / within))


@lru_cache(maxsize=MOST)
def _by_chance(n: int) -> float:
    """What the largest ``t`` of n normal numbers stays below."""
    drawn = np.random.default_rng(SEED).standard_normal((DRAWS, n))
    return float(np.quantile(_contrasts(drawn).max(axis=1), 1 - CHANCE))
