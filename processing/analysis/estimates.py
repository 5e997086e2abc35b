"""A number, where it lies with 95 % confidence, and how that is found: by drawing shots with replacement.

The standard deviation of ``ln D`` among the draws, times ``sqrt(m / (m - 1))`` for the bias of few, times Student's t
of ``m - 1`` degrees of freedom, with ``m`` drawn things; figures that may be negative as they are, not by their
logarithm. Percentiles of the draws and Efron's BCa hold the truth far less often where shots are few: see
``docs/spray.md``.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.special import stdtrit

from processing.geometry import FloatArray
from processing.reconstruction.settings import FrozenValue

CONFIDENCE = 0.95
FEW_SHOTS = 10
"""Fewer shots that happen to be alike would make an interval narrower than the number of their droplets allows: of 200
simulated sprays of two shots 8 to 25 % were so, and a third of these intervals held the truth. So droplets are drawn,
too, and the wider interval counts. More shots are hardly ever so alike."""
DRAWS, SEED = 400, 0
MANY = 10**6
"""Units of which Student's t is the normal distribution's."""
COUNTED_DRAWS = 100
"""Of droplets, where shots are drawn, too: a lower limit of the width may be known to 7 %."""
DROPLETS_AT_A_TIME = 2**18
"""Of all draws that are made at once: memory."""
Figures = Callable[[FloatArray], FloatArray]
"""Of how often each unit is taken, a row per draw, (rows, units): its figures, (rows, k)."""


class Estimate(FrozenValue):
    """A number, and where it lies with 95 % confidence."""

    value: Annotated[float, Field(description="the number")]
    low: Annotated[float, Field(description="it is not below this, with 97.5 %")]
    high: Annotated[float, Field(description="it is not above this, with 97.5 %")]

    def within(self, least: float, most: float) -> "Estimate":
        """The same with limits that are possible: a share is not above 1."""
        return Estimate(value=self.value, low=max(self.low, least), high=min(self.high, most))

    def no_surer_than(self, other: "Estimate | None") -> "Estimate":
        """The same with limits that are nowhere narrower than others."""
        if other is None:
            return self
        return Estimate(value=self.value, low=min(self.low, other.low), high=max(self.high, other.high))

    def less_sure(self, half_width: float) -> "Estimate":
        """A number above 0, with an error besides that does not depend on it: half its interval, over the number."""
        below, above = (float(np.hypot(np.log(ratio), half_width)) for ratio in self._ratios)
        return Estimate(value=self.value, low=self.value * np.exp(-below), high=self.value * np.exp(above))

    def without(self, half_width: float) -> "Estimate":
        """The same without such an error: what ``less_sure`` has added is taken off."""
        below, above = (float(np.sqrt(max(np.log(ratio) ** 2 - half_width**2, 0.0))) for ratio in self._ratios)
        return Estimate(value=self.value, low=self.value * np.exp(-below), high=self.value * np.exp(above))

    @property
    def _ratios(self) -> tuple[float, float]:
        return self.value / self.low, self.high / self.value


def draws(units: int, width: int, *, counting: bool = False, number: int = DRAWS) -> Iterator[FloatArray]:
    """How often each unit is taken when as many as there are are drawn with replacement; a row per draw.

    Parameters
    ----------
    units : int
        Shots; of a single one its droplets.
    width : int
        Droplets that a row is about: memory.
    counting : bool
        Each unit is taken a Poisson number of times: how many there are is left to chance, too.
    number : int
        Of draws.

    Yields
    ------
    (rows, units) array
        Some draws; all together ``number``, the same every time.
    """
    rng, rows = np.random.default_rng(SEED), max(1, DROPLETS_AT_A_TIME // max(width, units, 1))
    for first in range(0, number, rows):
        taken = min(rows, number - first)
        yield _taken(rng, taken, units) if not counting else rng.poisson(1.0, (taken, units)).astype(np.float64)


def _taken(rng: np.random.Generator, rows: int, units: int) -> FloatArray:
    places = rng.integers(0, units, (rows, units)) + units * np.arange(rows)[:, None]
    return np.bincount(places.ravel(), minlength=places.size).reshape(places.shape).astype(np.float64)


def drawn_figures(
    figures: Figures, units: int, width: int, *, counting: bool = False, number: int = DRAWS
) -> tuple[FloatArray, FloatArray]:
    """Figures as measured, (k,), and of every draw, (draws, k)."""
    (values,) = figures(np.ones((1, units)))
    return values, np.concatenate([figures(counts) for counts in draws(units, width, counting=counting, number=number)])


def standard_error(drawn: FloatArray, units: int, signed: bool | NDArray[np.bool_] = False) -> FloatArray:
    """Standard deviations of figures, (k,), of those that are not signed by their logarithm.

    Draws that do not have a figure, as of shots without droplets, say nothing of it.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        scaled = np.where(np.broadcast_to(signed, drawn.shape[1:]), drawn, np.log(drawn))
    known = np.ma.masked_invalid(scaled)
    error: FloatArray = np.ma.filled(np.ma.std(known, axis=0), np.nan) * np.sqrt(units / (units - 1))
    return error


def reach(units: int, confidence: float = CONFIDENCE) -> float:
    """Standard deviations from a figure to its limits: Student's t."""
    return float(stdtrit(units - 1, 1 - (1 - confidence) / 2))


def limits(
    values: FloatArray, half_widths: FloatArray, signed: bool | NDArray[np.bool_] = False
) -> tuple[FloatArray, FloatArray]:
    """Lower and upper limits; of figures that are not signed half widths are of their logarithm."""
    factors = np.exp(np.where(signed, 0.0, half_widths))
    lows = np.where(signed, values - half_widths, values / factors)
    return lows, np.where(signed, values + half_widths, values * factors)


def estimated(
    figures: Figures,
    units: int,
    width: int,
    *,
    counting: bool = False,
    number: int = DRAWS,
    widening: float = 1.0,
    signed: bool | NDArray[np.bool_] = False,
    confidence: float = CONFIDENCE,
) -> list[Estimate | None]:
    """Figures with their intervals; None where there is no number, or no interval, as of a single unit.

    Parameters
    ----------
    figures : callable
        Of how often each unit is taken.
    units, width, counting, number
        As of ``draws``.
    widening : float
        Of the intervals; the root of 2 where exposures A and B show the same droplets, and droplets are drawn.
    signed : bool or (k,) array of bool
        Which figures may be negative.
    confidence : float
        Of the intervals.
    """
    if units < 2:
        return [None] * figures(np.ones((1, units))).shape[1]
    values, drawn = drawn_figures(figures, units, width, counting=counting, number=number)
    half_widths = widening * reach(units, confidence) * standard_error(drawn, units, signed)
    return [
        Estimate(value=value, low=low, high=high) if np.isfinite([value, low, high]).all() else None
        for value, low, high in zip(
            values.tolist(), *(ends.tolist() for ends in limits(values, half_widths, signed)), strict=True
        )
    ]


def weighted_quantiles(values: FloatArray, weights: FloatArray, shares: Sequence[float]) -> FloatArray:
    """Values below which so much of the weight lies.

    Parameters
    ----------
    values : (N,) array
        Sorted.
    weights : (rows, N) array
        Of each value, row by row.
    shares : sequence of k float
        0 to 1.

    Returns
    -------
    (rows, k) array
        Not a number where a row has no weight.
    """
    summed = np.cumsum(weights, axis=1)
    wanted = summed[:, -1:] * np.asarray(shares)
    below = np.array([np.searchsorted(row, row_wanted) for row, row_wanted in zip(summed, wanted, strict=True)])
    return np.where(summed[:, -1:] > 0, values[np.minimum(below, len(values) - 1)], np.nan)
