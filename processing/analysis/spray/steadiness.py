"""Whether a spray stays what it is over its shots: else its means are of no one spray, and their intervals of nothing.

In the order in which they were taken, shots are split in two wherever the parts differ most, and a straight line is
laid through them: ``t`` is a difference, or a slope, over its standard error, as shots scatter beside it. How large
chance makes the largest ``t`` of so many shots of one spray is drawn from normal numbers (a change at a place that
nobody knows: Hawkins, Testing a sequence of observations for a shift in location, JASA 72, 1977). Shots of two sprays
in turns are two heaps: the same is asked of the shots in the order of their values, beside normal numbers in theirs
(Engelman and Hartigan, Percentage points of a test for clusters, JASA 64, 1969). A single shot unlike all
others is asked in the same way: it and the rest are the parts. More than 60 shots are taken in groups, which hides
turns and single shots.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from processing.analysis.estimates import SEED
from processing.analysis.spray.cone import tilt_addends, tilts_deg
from processing.analysis.spray.spray_axis import SprayAxis, direction_name
from processing.analysis.spray.spray_sample import SpraySample
from processing.geometry import FloatArray

FEWEST, MOST = 4, 60
"""Shots, and groups of them; each part has two at least."""
FEWEST_DROPLETS = 5
"""Of a group."""
CHANCE, DRAWS = 0.001, 10_000
"""How often chance makes as much of one of some twelve figures, twice: two of a hundred sprays are called so."""
LEAST_RATIO, LEAST_RATIO_NUMBER = 1.05, 1.1
"""Of what matters, whatever chance does: of D32, speed and angles; of the number of droplets."""
LEAST_TURN_DEG = 1.5
"""Of the direction, and of the nozzle as droplets see it."""
LEAST_SHIFT = 0.1
"""Of how widely droplets lie along x, y or z: standard deviations."""
FEWEST_OF_ODD, LEAST_ODD = 6, 3.0
"""Shots, to call a single one odd; how many times as much it must change as a part of them."""
EXACT = float(np.finfo(float).eps)
"""Share of the scatter that rounding leaves beside a change that explains all of it."""
Parts = Literal["order", "turns", "one"]
"""In what a spray may be split: first and later shots, shots of two kinds in turns, one shot and the others."""
REMEDY = "means over them are of no one spray, and intervals do not know it: take those apart that belong together"


@dataclass(frozen=True, eq=False)
class _Series:
    """A figure of every group of shots, how it is said, and how much of a change matters: a ratio, or a difference."""

    text: str
    values: FloatArray
    least_ratio: float | None = None
    least: float = 0.0
    in_turns: bool = True
    in_one: bool = True

    def matters(self, before: float, after: float) -> bool:
        return self.matters_more(before, after, 1.0)

    def matters_more(self, before: float, after: float, times: float) -> bool:
        """Likewise, so many times as much."""
        if self.least_ratio is None:
            return bool(abs(after - before) > times * self.least)
        return bool(max(before, after) > self.least_ratio**times * min(before, after))


def changes_of_spray(sample: SpraySample, axis: SprayAxis | None = None) -> tuple[str, ...]:
    """Say what of a spray changes from its first shots to its last ones, or is of two kinds.

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
    series = [*_of_numbers(sample, groups), *_of_flight(sample, axis, groups), *_of_places(sample, axis, groups)]
    told = [said for one in series if (said := _in_order(one, groups) or _in_turns(one) or _in_one(one, sample))]
    return (f"the spray changes over its shots: {'; '.join(told)}: {REMEDY}",) if told else ()


def _of_numbers(sample: SpraySample, groups: NDArray[np.intp]) -> Iterator[_Series]:
    """Droplets per volume, which gusts make of any kind, and mean diameters: D10 knows a change sooner than D32."""
    with np.errstate(invalid="ignore", divide="ignore"):
        per_mm3 = np.bincount(groups[sample.shot], minlength=groups[-1] + 1) / np.bincount(groups, sample.volumes_mm3)
    yield _Series("droplets per mm3 are {}", per_mm3, LEAST_RATIO_NUMBER, in_turns=False, in_one=False)
    d_um = sample.diameters_um
    number, length, area, volume = _sums(d_um[:, None] ** np.arange(4), sample, groups).T
    yield _Series("D10 is {} um", length / number, LEAST_RATIO)
    yield _Series("D32 is {} um", volume / area, LEAST_RATIO, in_turns=False, in_one=False)  # large ones make heaps


def _of_flight(sample: SpraySample, axis: SprayAxis | None, groups: NDArray[np.intp]) -> Iterator[_Series]:
    """Speed, direction, how far from it droplets fly, and where they come from."""
    flying = sample.flying
    if not len(flying):
        return
    speeds_m_s = np.linalg.norm(flying.velocities_m_s, axis=1)
    ways = flying.velocities_m_s / speeds_m_s[:, None]
    main = axis or SprayAxis((0, 0, 0), tuple(ways.mean(axis=0).tolist()))
    from_deg = np.degrees(np.arccos(np.clip(ways @ main.frame[0], -1, 1)))
    speed_m_s, cone_deg = _means(np.column_stack([speeds_m_s, from_deg]), flying, groups).T
    yield _Series("speed is {} m/s", speed_m_s, LEAST_RATIO)
    yield _Series("droplets fly {} degrees from their axis", cone_deg, LEAST_RATIO)
    turns_deg = tilts_deg(_sums(tilt_addends(main, ways), flying, groups))
    yield from _across("their axis leans to {} by {{}} degrees", turns_deg, main, LEAST_TURN_DEG)
    if axis:
        crossed_mm = _means(axis.crossings_mm(flying.points_mm, ways), flying, groups)
        least_mm = float(np.tan(np.radians(LEAST_TURN_DEG)) * axis.coordinates(flying.points_mm)[0].mean())
        yield from _across("along {} they come from {{}} mm beside the nozzle", crossed_mm, axis, least_mm)


def _across(text: str, values: FloatArray, axis: SprayAxis, least: float) -> Iterator[_Series]:
    """Of values along the two directions across an axis, (groups, 2)."""
    for direction, column in zip(axis.frame[1:], values.T, strict=True):
        yield _Series(text.format(direction_name(direction)), column, least=least)


def _of_places(sample: SpraySample, axis: SprayAxis | None, groups: NDArray[np.intp]) -> Iterator[_Series]:
    """Where droplets lie in the mean, and how far from the axis the nozzle sees them."""
    if axis:
        along_mm, from_mm, _ = axis.coordinates(sample.points_mm)
        (seen_deg,) = _means(np.degrees(np.arctan2(from_mm, along_mm))[:, None], sample, groups).T
        yield _Series("seen from the nozzle droplets lie {} degrees from the axis", seen_deg, LEAST_RATIO)
    least_mm = LEAST_SHIFT * sample.points_mm.std(axis=0) if len(sample) else np.zeros(3)
    for name, places_mm, least in zip("xyz", _means(sample.points_mm, sample, groups).T, least_mm, strict=True):
        yield _Series(f"in the mean droplets lie at {name} = {{}} mm", places_mm, least=float(least), in_one=False)


def _sums(values: FloatArray, sample: SpraySample, groups: NDArray[np.intp]) -> FloatArray:
    """Of values of the droplets, (N, k), by groups: (groups, k); not a number where a group has too few of them."""
    group, count = groups[sample.shot], groups[-1] + 1
    sums = np.column_stack([np.bincount(group, column, count) for column in values.T])
    few = np.bincount(group, minlength=count) < FEWEST_DROPLETS
    return np.where(few[:, None], np.nan, sums)


def _means(values: FloatArray, sample: SpraySample, groups: NDArray[np.intp]) -> FloatArray:
    sums = _sums(np.column_stack([values, np.ones(len(values))]), sample, groups)
    return np.asarray(sums[:, :-1] / sums[:, -1:])


def _in_order(series: _Series, groups: NDArray[np.intp]) -> str:
    """How a figure changes from the first shots to the last ones; nothing where it does not, or chance explains it."""
    known = np.flatnonzero(np.isfinite(series.values))
    if not (split := _split(series.values[known], "order")):
        return ""
    shots = int(np.searchsorted(groups, known[split]))
    return _said(series, series.values[known], split, f"in the first {shots} shots", f"in {len(groups) - shots} later")


def _in_turns(series: _Series) -> str:
    """What a figure is in shots of two kinds; nothing where there are none."""
    values = np.sort(series.values[np.isfinite(series.values)])
    if not series.in_turns or not (split := _split(values, "turns")):
        return ""
    share = round(100 * split / len(values))
    return _said(series, values, split, f"in {share} % of the shots", "in the others, in turns")


def _in_one(series: _Series, sample: SpraySample) -> str:
    """What a figure is in the one shot that is unlike all others; nothing where there is none.

    Of shots with half as many droplets as most have: values of fewer scatter more, and weigh less.
    """
    numbers = np.bincount(sample.shot, minlength=len(sample.volumes_mm3))
    if not series.in_one or len(numbers) != len(series.values):
        return ""
    asked = np.flatnonzero(np.isfinite(series.values) & (numbers >= np.median(numbers) / 2))
    if len(asked) < FEWEST_OF_ODD or not np.ptp(values := series.values[asked]):
        return ""
    (t,) = _contrasts(values[None], "one")
    odd = int(np.argmax(t))
    parts = np.append(np.delete(values, odd), values[odd])
    if t[odd] <= _by_chance(len(asked), "one") or not series.matters_more(parts[:-1].mean(), parts[-1], LEAST_ODD):
        return ""
    return _said(
        series, parts, len(asked) - 1, "in the other shots", f"in one, the {asked[odd] + 1}. of {len(numbers)}"
    )


def _said(series: _Series, values: FloatArray, split: int, first: str, second: str) -> str:
    before, after = float(values[:split].mean()), float(values[split:].mean())
    return (
        f"{series.text.format(f'{before:.3g}')} {first}, {after:.3g} {second}" if series.matters(before, after) else ""
    )


def _split(values: FloatArray, parts: Parts) -> int:
    """Before which value a figure changes, if chance does not explain it; else 0."""
    n = len(values)
    if n < FEWEST or np.ptp(values) == 0:
        return 0
    (t,) = _contrasts(values[None], parts)
    return 2 + int(np.argmax(t[: n - 3])) if t.max() > _by_chance(n, parts) else 0


def _patterns(n: int, parts: Parts) -> FloatArray:
    """Every split, each part of two values at least, in order a straight line besides; or each value by itself."""
    if parts == "one":
        return np.eye(n)
    after = (np.arange(n) >= np.arange(2, n - 1)[:, None]).astype(np.float64)
    return np.vstack([after, np.arange(n)]) if parts == "order" else after


def _contrasts(rows: FloatArray, parts: Parts) -> FloatArray:
    """Amount of ``t`` of every pattern, (rows, patterns)."""
    n = rows.shape[1]
    patterns = _patterns(n, parts)
    patterns -= patterns.mean(axis=1, keepdims=True)
    patterns /= np.linalg.norm(patterns, axis=1, keepdims=True)
    centred = rows - rows.mean(axis=1, keepdims=True)
    between = (centred @ patterns.T) ** 2
    total = np.sum(centred**2, axis=1, keepdims=True)
    within = np.maximum(total - between, EXACT * total + np.finfo(float).tiny)
    return np.asarray(np.sqrt(between * (n - 2) / within))


@lru_cache(maxsize=3 * MOST)
def _by_chance(n: int, parts: Parts) -> float:
    """What the largest ``t`` of n normal numbers stays below, as they come or in the order of their values."""
    drawn = np.random.default_rng(SEED).standard_normal((DRAWS, n))
    t = _contrasts(np.sort(drawn) if parts == "turns" else drawn, parts)
    return float(np.quantile(t.max(axis=1), 1 - CHANCE))
