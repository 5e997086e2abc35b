"""Intervals of the parameters of fits to the volume of droplets, over shots.

Droplets are counted in fine classes of ln d, so that a fit of a draw takes no longer for more droplets.
"""

import numpy as np
from scipy.sparse import csr_array

from processing.analysis.estimates import CONFIDENCE, Estimate, Figures
from processing.analysis.spray.spray_sample import SpraySample
from processing.analysis.unseen_tail import DrawnSprays, drawn_sprays, with_unseen
from processing.geometry import FloatArray

CLASSES = 400
"""Each stands for its mean, and is narrower than 2 % where droplets differ by less than 1000 times."""
STEPS = 20
LEAST_Q, MOST_Q = 0.05, 500.0
START = 1.28
"""Exponent of Rosin and Rammler times the standard deviation of ln d: pi over the root of 6."""


def fit_estimates(sample: SpraySample) -> dict[str, tuple[Estimate | None, Estimate | None]]:
    """Scale in um and shape of both fits, by their names, with 95 % intervals; none of a single droplet."""
    logs = np.log(sample.diameters_um)
    edges = np.linspace(logs.min(), logs.max(), CLASSES + 1)
    classes = np.clip(np.searchsorted(edges, logs, side="right") - 1, 0, CLASSES - 1)
    cubes = sample.cubes_um3 / sample.cubes_um3.max()
    own = np.bincount(classes, cubes, CLASSES)
    means = np.where(own > 0, np.bincount(classes, cubes * logs, CLASSES) / np.maximum(own, 1e-300), edges[:-1])

    def figures_of(drawn: SpraySample) -> Figures:
        return _figures(csr_array((cubes, (drawn.units, classes)), shape=(drawn.n_units, CLASSES)), means)

    told = sample.estimated(figures_of)
    if sprays := drawn_sprays(sample.diameters_um, sample.exposures_per_shot):
        told = [one and with_unseen(one, off, CONFIDENCE) for one, off in zip(told, _off(sprays).T, strict=True)]
    scale_um, spread, x_um, q = told
    return {"lognormal": (scale_um, spread), "rosin-rammler": (x_um, q)}


def _off(sprays: DrawnSprays) -> FloatArray:
    """Logarithms of the four parameters of each sample less those of its spray, (rows, 4).

    Of a lognormal spray of spread s they are 3 s^2, ln s, 3 s^2 + s / 2 and -ln s: the likelihood of Rosin and Rammler
    is largest where q s = 1. Scales of ln d leave the equation of q as it is, so that it is solved in units of s.
    """
    spreads = sprays.spreads
    median, spread, x, q = _of_weights(sprays.by_volume, sprays.levels).T
    by_volume = 3 * spreads**2
    return np.column_stack(
        [
            spreads * np.log(median) - by_volume,
            np.log(spread),
            spreads * np.log(x) - by_volume - spreads / 2,
            np.log(q),
        ]
    )


def _figures(volumes: csr_array, logs: FloatArray) -> Figures:
    """Median and standard deviation of ln d, X and q (rows, 4), of how often each unit is taken."""

    def figures(counts: FloatArray) -> FloatArray:
        return _of_weights(counts @ volumes, logs)

    return figures


def _of_weights(volumes: FloatArray, logs: FloatArray) -> FloatArray:
    """The same of the volume in each class, (rows, classes)."""
    with np.errstate(invalid="ignore", divide="ignore"):
        weights = volumes / volumes.sum(axis=1, keepdims=True)
        mean = weights @ logs
        spread = np.sqrt(np.maximum(weights @ logs**2 - mean**2, 0))
        x_um, q = _rosin_rammler(weights, logs, mean, spread)
        return np.column_stack([np.exp(mean), spread, x_um, q])


def _rosin_rammler(
    weights: FloatArray, logs: FloatArray, mean: FloatArray, spread: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Where the derivative of the likelihood vanishes, by Newton's steps in the exponent, row by row."""
    top = logs.max()
    q = np.clip(START / spread, LEAST_Q, MOST_Q)
    for _ in range(STEPS):
        powers = weights * np.exp(q[:, None] * (logs - top))
        total = powers.sum(axis=1)
        first = powers @ (logs - top) / total
        second = powers @ (logs - top) ** 2 / total
        slope, bend = 1 / q + (mean - top) - first, -1 / q**2 - (second - first**2)
        q = np.clip(q - slope / bend, q / 2, 2 * q)
        q = np.clip(q, LEAST_Q, MOST_Q)
    powers = weights * np.exp(q[:, None] * (logs - top))
    return np.exp(top + np.log(powers.sum(axis=1)) / q), q
