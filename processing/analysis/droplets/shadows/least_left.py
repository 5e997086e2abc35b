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
    """The vertex of a parabola through the best step and its neighbours, each draw by its own.

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
    levels = np.array([tried[step] for step in sorted(tried)])
    number = levels.shape[1]
    draws = np.random.default_rng(0).integers(0, number, (DRAWS, number))
    others = _lowest(levels[:, draws].mean(axis=2))
    return LeastLeft(float(min(tried) + _lowest(levels.mean(axis=1))), float(np.std(others)))


def _best(tried: dict[int, FloatArray]) -> int:
    return min(tried, key=lambda step: float(tried[step].mean()))


def _next(tried: dict[int, FloatArray], lowest: int, highest: int) -> int | None:
    """The step beyond the best one, if that is the last on its side; None where both neighbours are known."""
    best = _best(tried)
    beyond = [step for step in (best - 1, best + 1) if lowest <= step <= highest and step not in tried]
    return beyond[0] if beyond else None


def _lowest(left: FloatArray) -> FloatArray:
    """Where least is left of what is at successive steps (steps, ...), in steps from the first; draws may differ."""
    best = np.clip(left.argmin(axis=0), 1, len(left) - 2)
    before, at, beyond = (np.take_along_axis(left, (best + aside)[None], axis=0)[0] for aside in (-1, 0, 1))
    bend = np.maximum(before + beyond - 2 * at, 1e-12)
    lowest: FloatArray = best + np.clip(0.5 * (before - beyond) / bend, -1.0, 1.0)
    return lowest
