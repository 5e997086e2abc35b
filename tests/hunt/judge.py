"""Compares what was said with what is true: a lie is a wrong number that is told as good.

A number is wrong that is off by more than 3 %, and by more than its own interval: 3 standard deviations, which are 1.5
times the half width of 95 %. It is excused where its shot is not *good*, where a doubt is told of all shots together,
or where ``not_checked`` names what went wrong.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from tests.hunt.answer import Answer, Told
from tests.hunt.rig import SCALE_PX_PER_MM, Array
from tests.hunt.world import HALF_MM, SEPARATION_NS, Cloud, World

LEAST_WRONG = 0.03
SURE = 1.5
"""Half widths of an interval of 95 %: three standard deviations."""
NEAR_MM = 2.5 / SCALE_PX_PER_MM
"""A told droplet that far from any true one is none."""
LEAST_STRAY, LEAST_STRAYS = 0.1, 3
"""Share of the droplets, and number, that may be missed or be ghosts: docs/how-sure.md promises fewer, in the mean."""
SIZES = ("d10_um", "d32_um", "d43_um", "dv10_um", "dv50_um", "dv90_um")
OF_B = " b"
"""Ends what is told of droplets in exposure B, which a doubt of velocities casts doubt on, too: A again, or another."""
TOGETHER = ("conditions_changed", "copies", "same_droplets", "depth", "few_together")


@dataclass(frozen=True)
class Wrong:
    """A number that is off, in units of its own.

    Parameters
    ----------
    number : str
        Which.
    told, true : float
        Both.
    allowed : float
        How far they may lie apart.
    error : float
        How far they do, over what is true; of a velocity, over the speed.
    """

    number: str
    told: float
    true: float
    allowed: float
    error: float


@dataclass(frozen=True)
class Verdict:
    """What became of a case.

    Parameters
    ----------
    outcome : str
        "lie", "named" (wrong, but ``not_checked`` says of what), "right", "doubted" or "refused".
    wrong : tuple of Wrong
        Of a lie or what is named: numbers that nobody doubts, the worst one first.
    doubts : tuple of str
        All that was doubted.
    """

    outcome: str
    wrong: tuple[Wrong, ...]
    doubts: tuple[str, ...]


def judged(world: World, answer: Answer, named: Sequence[str]) -> Verdict:
    """Compare an answer with the truth; ``named`` are words for what went wrong."""
    if answer.error:
        return Verdict("refused", (), (answer.error,))
    doubts, of_velocities = _doubts(answer, world.exposures)
    wrong = [] if doubts else list(_wrong_droplets(world, answer))
    if of_velocities:
        wrong = [one for one in wrong if not one.number.endswith(OF_B)]
    elif not doubts:
        wrong += _wrong_velocities(world, answer)
    ordered = tuple(sorted(wrong, key=lambda one: -abs(one.error)))
    if ordered:
        unchecked = " ".join(one["what"] for one in answer.said["not_checked"])
        excused = any(words and words in unchecked for words in named)
        return Verdict("named" if excused else "lie", ordered, (*doubts, *of_velocities))
    refused = all(shot["verdict"] == "refused" for shot in answer.said["shots"])
    told = "refused" if refused else "doubted" if doubts or of_velocities else "right"
    return Verdict(told, (), (*doubts, *of_velocities))


def _doubts(answer: Answer, exposures: int) -> tuple[list[str], list[str]]:
    """Of droplets, and of velocities alone."""
    together = [text for name in TOGETHER for text in answer.said.get(name, ())]
    together += [str(text) for text in answer.spray.get("doubts", ())]
    droplets = [text for shot in answer.said["shots"] for text in _reasons(shot)]
    velocities = [text for shot in answer.said["shots"] if shot["velocity"] for text in _reasons(shot["velocity"])]
    if exposures > 1:
        velocities += [shot["velocity_reason"] for shot in answer.said["shots"] if not shot["velocity"]]
    return [*droplets, *together], velocities


def _reasons(told: dict[str, Any]) -> list[str]:
    return [] if told["verdict"] == "good" else [f"{told['verdict']}: {text}" for text in told["reasons"] or ("",)]


def in_box(cloud: Cloud) -> Cloud:
    """Droplets whose middles are in the box."""
    return cloud.kept(np.all(abs(cloud.places_mm) <= HALF_MM, axis=1))


def _true(world: World) -> dict[tuple[int, int], Cloud]:
    exposures = [(shot, cloud.round) for shot, cloud in enumerate(world.clouds)]
    pairs = (((shot, n), one) for shot, cloud in exposures for n, one in enumerate((cloud, cloud.moved)))
    return {place: in_box(one) for place, one in pairs if place[1] < world.exposures}


def _wrong_droplets(world: World, answer: Answer) -> Iterator[Wrong]:
    true = _true(world)
    nothing = Told(np.empty((0, 3)), np.empty(0), np.empty(0), np.empty((0, 3)))
    for place, cloud in true.items():
        told = answer.told.get(place, nothing)
        yield from _stray(told, cloud, "ab"[place[1]])
    statistics = answer.said["statistics"]
    volume_mm3 = float(np.prod(2 * HALF_MM))
    density = np.mean([len(cloud.diameters_um) for cloud in true.values()]) / volume_mm3
    yield from _beyond("number_density_per_mm3", statistics["number_density_per_mm3"], float(density))
    if world.polarity == "bright":
        return
    diameters_um = np.concatenate([cloud.diameters_um for cloud in true.values()])
    for name in SIZES:
        yield from _beyond(name, statistics[name], mean_um(name, diameters_um))
    yield from _alike(true, answer, statistics["light_sd_um"])


def mean_um(name: str, diameters_um: Array) -> float:
    """A mean diameter, or a quantile by volume, after ISO 9276-2."""
    if name.startswith("dv"):
        ordered = np.sort(diameters_um)
        share = np.cumsum(ordered**3) / np.sum(ordered**3)
        return float(np.interp(int(name[2:4]) / 100, share, ordered))
    p, q = int(name[1]), int(name[2])
    return float((np.sum(diameters_um**p) / np.sum(diameters_um**q)) ** (1 / (p - q)))


def _beyond(name: str, told: dict[str, float] | None, true: float) -> Iterator[Wrong]:
    """A number with an interval of 95 %."""
    if told is None:
        return
    half = told["high"] - told["value"] if true > told["value"] else told["value"] - told["low"]
    yield from _wrong(name, told["value"], true, SURE * half, true)


def _wrong(name: str, told: float, true: float, allowed: float, whole: float) -> Iterator[Wrong]:
    if abs(told - true) > max(allowed, LEAST_WRONG * abs(whole)):
        yield Wrong(name, float(told), float(true), float(allowed), float((told - true) / whole))


def _stray(told: Told, cloud: Cloud, exposure: str) -> Iterator[Wrong]:
    """How many there are, and how many of those that are told lie where none is."""
    count, found = len(cloud.diameters_um), len(told.places_mm)
    allowed = max(LEAST_STRAYS, LEAST_STRAY * count)
    yield from _wrong(f"count {exposure}", found, count, allowed, max(count, 1))
    if found:
        far_mm = cKDTree(cloud.places_mm).query(told.places_mm)[0] if count else np.full(found, np.inf)
        strays = int(np.sum(far_mm > NEAR_MM))
        yield from _wrong(f"places {exposure}", found, found - strays, max(LEAST_STRAYS, LEAST_STRAY * found), found)


def _alike(true: dict[tuple[int, int], Cloud], answer: Answer, light_sd_um: float) -> Iterator[Wrong]:
    """Error that all diameters have in common: nothing but the light may explain it, however few droplets there are."""
    told, right, deviations = [], [], []
    for place, cloud in true.items():
        if (seen := answer.told.get(place)) and len(cloud.places_mm):
            far_mm, own = map(np.asarray, cKDTree(cloud.places_mm).query(seen.places_mm))
            near = far_mm < NEAR_MM
            told += list(seen.diameters_um[near])
            right += list(cloud.diameters_um[own[near]])
            deviations += list(seen.deviations_um[near])
    if len(told) < 5:
        return
    error = float(np.median(np.array(told) / right - 1))
    middle_um = float(np.median(right))
    allowed = 3 * np.hypot(light_sd_um, 1.25 * np.median(deviations) / np.sqrt(len(told)))
    yield from _wrong("diameters", middle_um * (1 + error), middle_um, float(allowed), middle_um)


def _wrong_velocities(world: World, answer: Answer) -> Iterator[Wrong]:
    means = answer.said["velocity"] and answer.said["velocity"]["mean_m_s"]
    if not means:
        return
    clouds = [in_box(cloud.round) for cloud in world.clouds]
    stay = [cloud.kept(np.all(abs(cloud.moved.places_mm) <= HALF_MM, axis=1)) for cloud in clouds]
    ways_mm = np.concatenate([cloud.ways_mm for cloud in stay])
    if not len(ways_mm):
        return
    true_m_s = 1e-3 * ways_mm.mean(axis=0) / (1e-9 * SEPARATION_NS)
    speed_m_s = float(np.linalg.norm(true_m_s))
    for name, true in zip("uvw", true_m_s, strict=True):
        told = means[name]
        half = told["high"] - told["value"] if true > told["value"] else told["value"] - told["low"]
        yield from _wrong(name, told["value"], float(true), SURE * half, max(speed_m_s, 1e-6))
