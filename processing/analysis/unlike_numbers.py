"""Do both exposures show as many droplets? They show the same ones, but for a few that fly into the box or out of it.

Densities and means are of both exposures together, and nothing else tells where one of them lacks its light, or its
spray: an exposure without droplets is a good one of an empty box. Nor does anything else tell of a whole shot without
light, or of a spray that is there in one of many shots.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import bdtr, pdtr, pdtrc

from processing.analysis.droplets.droplet_file import FRAME, StoredDroplets
from processing.analysis.droplets.droplet_statistics import hidden_share, measured_mm3, told_exposures
from processing.geometry import FloatArray

MOST_RATIO, MOST_RATIO_OF_SHOTS = 1.5, 1.1
"""Of the larger number to the smaller one, of one shot, and of all shots together."""
MOST_OF_A_SHOT, CHANCE_OF_A_SHOT = 5.0, 1e-4
"""Ratio of the droplets of a shot and a median one of the others, beyond all gusts; how often counting makes it."""
CHANCE = 0.01
"""How often as many droplets of one density fall on two exposures so unlike, were they not the very same ones."""


def unlike_numbers(first: int, second: int, most_ratio: float = MOST_RATIO) -> str:
    """What is wrong where exposure A has so many droplets, and B so many others; empty where nothing says so.

    Parameters
    ----------
    first, second : int
        Droplets of A, and of B.
    most_ratio : float
        Of the larger number to the smaller one.
    """
    fewer, more = sorted((first, second))
    if more <= most_ratio * fewer or 2 * bdtr(fewer, fewer + more, 0.5) > CHANCE:
        return ""
    return (
        f"exposure A has {first} droplets, B {second}: both show the same ones, but for a few that fly into the box or "
        "out of it; densities and means are of both together. Does the light flash in both, as bright, and does the "
        "spray last from A to B?"
    )


def unlike_numbers_of_shots(shots: Sequence[StoredDroplets]) -> str:
    """The same of all double exposures together, of which neither exposure is refused."""
    numbers = [
        int(np.count_nonzero(shot.columns[FRAME].astype("U1") == frame))
        for shot in shots
        if {"a", "b"} <= shot.exposures.keys() and len(told_exposures(shot)) == len(shot.exposures)
        for frame in "ab"
    ]
    told = unlike_numbers(sum(numbers[::2]), sum(numbers[1::2]), MOST_RATIO_OF_SHOTS)
    return f"all shots together: {told}" if told else ""


def unlike_shots(shots: Sequence[StoredDroplets]) -> str:
    """What is wrong where some shots have far more or fewer droplets than the others; empty where nothing says so.

    Asked is how many there are where liquid hides none. Shots that are refused, or all hidden, do not count.
    """
    told = [(shot, exposures) for shot in shots if (exposures := told_exposures(shot))]
    parts = _seen_parts(told)
    seen = [(shot, len(exposures), part) for (shot, exposures), part in zip(told, parts, strict=True) if part]
    counts = [round(len(shot.columns[FRAME]) / exposures) for shot, exposures, _ in seen]
    seen_parts = np.array([part / exposures for _, exposures, part in seen])
    usual, fewest, most = (_by_the_others(many, seen_parts) for many in _within_chance(np.array(counts)))
    odd = [place for place, count in enumerate(counts) if _is_odd(count, fewest[place], most[place])]
    if not odd:
        return ""
    first = odd[0]
    return (
        f"{len(odd)} of {len(counts)} shots have {MOST_OF_A_SHOT:g} times more or fewer droplets than the others, "
        f"where liquid hides none ({seen[first][0].name}: {counts[first]}, by a median one of the others: "
        f"{usual[first]:.3g}): does the light flash in all of them, and does the spray last? Means over them are of "
        "no one spray, and intervals hardly know it"
    )


def _seen_parts(told: Sequence[tuple[StoredDroplets, Sequence[Mapping[str, Any]]]]) -> list[float]:
    """What could be measured, of all exposures of a shot: mm3, or shares of a volume that some files do not tell."""
    volumes_mm3 = [one for shot, exposures in told if (one := measured_mm3(shot, exposures)) is not None]
    if len(volumes_mm3) == len(told):
        return volumes_mm3
    return [sum(1 - hidden_share(one) for one in exposures) for _, exposures in told]


def _within_chance(counts: NDArray[Any]) -> tuple[NDArray[Any], FloatArray, FloatArray]:
    """Droplets that are seen of each shot, and fewer and more that chance may well make of a median of as many."""
    chance = np.sqrt(counts / max(len(counts) - 1, 1))
    return counts, counts - chance, np.maximum(counts + chance, 1.0)


def _by_the_others(counts: NDArray[Any], parts: FloatArray) -> list[float]:
    """Droplets that each shot would have by the median density of the others, if these had so many."""
    if len(counts) < 2:
        return list(map(float, counts))
    others = [np.median(np.delete(counts / parts, place)) for place in range(len(counts))]
    return [float(one) for one in parts * others]


def _is_odd(count: int, fewest: float, most: float) -> bool:
    """Whether chance hardly makes so many, or so few, where there are these by the others."""
    many = count > MOST_OF_A_SHOT * most and float(pdtrc(count - 1, most)) < CHANCE_OF_A_SHOT
    return many or (MOST_OF_A_SHOT * count < fewest and float(pdtr(count, fewest)) < CHANCE_OF_A_SHOT)
