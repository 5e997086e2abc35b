"""Which of several ways to read the images leaves least around droplets that are fitted anew, and how sure that is."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from processing.geometry import FloatArray

DRAWS = 100
"""Of droplets with replacement."""


@dataclass(frozen=True)
class LeastLeft:
    """Where least is left.

    Parameters
    ----------
    step, sd : float
        In steps from the images as they are, with its standard deviation.
    """

    step: float
    sd: float


def least_left(left: Callable[[int], FloatArray], lowest: int, highest: int) -> LeastLeft:
    """The vertex of a parabola through the best step and its neighbours.

    Parameters
    ----------
    left : callable
        What is left around each of N droplets, squared, so many steps away.
    lowest, highest : int
        Steps that are tried at most.
    """
    tried = {step: np.log(np.maximum(left(step), 1e-12)) for step in (-1, 0, 1)}
    while (step := _next(tried, lowest, highest)) is not None:
        tried[step] = np.log(np.maximum(left(step), 1e-12))
    best = min(max(_best(tried), min(tried) + 1), max(tried) - 1)
    around = np.array([tried[best + aside] for aside in (-1, 0, 1)])
    number = around.shape[1]
    draws = np.random.default_rng(0).integers(0, number, (DRAWS, number))
    return LeastLeft(float(best + _vertex(around.mean(axis=1))), float(np.std(_vertex(around[:, draws].mean(axis=2)))))


def _best(tried: dict[int, FloatArray]) -> int:
    return min(tried, key=lambda step: float(tried[step].mean()))


def _next(tried: dict[int, FloatArray], lowest: int, highest: int) -> int | None:
    """The step beyond the best one, if that is the last on its side; None where both neighbours are known."""
    best = _best(tried)
    beyond = [step for step in (best - 1, best + 1) if lowest <= step <= highest and step not in tried]
    return beyond[0] if beyond else None


def _vertex(around: FloatArray) -> FloatArray:
    """Of parabolas through what is left one step before, at, and one step beyond (3, ...), in steps; 1 at most."""
    before, at, beyond = around
    bend = np.maximum(before + beyond - 2 * at, 1e-12)
    vertex: FloatArray = np.clip(0.5 * (before - beyond) / bend, -1.0, 1.0)
    return vertex
