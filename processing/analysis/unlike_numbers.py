"""Do both exposures show as many droplets? They show the same ones, but for a few that fly into the box or out of it.

Densities and means are of both exposures together, and nothing else tells where one of them lacks its light, or its
spray: an exposure without droplets is a good one of an empty box. Nor does anything else tell of a whole shot without
light, or of a spray that is there in one of many shots.
"""

from collections.abc import Sequence

import numpy as np
from scipy.special import bdtr, pdtr, pdtrc

from processing.analysis.droplets.droplet_file import FRAME, StoredDroplets
from processing.analysis.droplets.droplet_statistics import told_exposures

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

    Those that are refused do not count.
    """
    told = [(shot, len(told_exposures(shot))) for shot in shots]
    counts = [(shot.name, round(len(shot.columns[FRAME]) / exposures)) for shot, exposures in told if exposures]
    odd = [place for place in range(len(counts)) if _is_odd(*_beside([count for _, count in counts], place))]
    if not odd:
        return ""
    name, count = counts[odd[0]]
    _, median = _beside([one for _, one in counts], odd[0])
    return (
        f"{len(odd)} of {len(counts)} shots have {MOST_OF_A_SHOT:g} times more or fewer droplets than the others "
        f"({name}: {count}, a median one of the others: {median:g}): does the light flash in all of them, and does "
        "the spray last? Means over them are of no one spray, and intervals hardly know it"
    )


def _beside(counts: Sequence[int], place: int) -> tuple[int, float]:
    """Droplets of a shot, and of a median one of the others."""
    others = [*counts[:place], *counts[place + 1 :]]
    return counts[place], float(np.median(others)) if others else float(counts[place])


def _is_odd(count: int, usual: float) -> bool:
    if count > usual:
        return count > MOST_OF_A_SHOT * usual and float(pdtrc(count - 1, max(usual, 1.0))) < CHANCE_OF_A_SHOT
    return MOST_OF_A_SHOT * count < usual and float(pdtr(count, usual)) < CHANCE_OF_A_SHOT
