"""Where the ticks of an axis stand. Pure."""

import math

_MOST = 6


def ticks_of(low: float, high: float, most: int = _MOST) -> list[float]:
    """Round numbers, evenly spaced, from ``low`` to ``high``: at least one, and no more than ``most``."""
    step = _step((high - low) / most)
    while math.floor(high / step) - math.ceil(low / step) + 1 > most:
        step = _step(step * 1.001)
    found = [number * step for number in range(math.ceil(low / step), math.floor(high / step) + 1)]
    return [round(tick, 9) for tick in found] or [round(0.5 * (low + high), 9)]


def _step(least: float) -> float:
    """The smallest of 1, 2, 5, 10, ... that is not below."""
    power = 10.0 ** math.floor(math.log10(least))
    return next(factor * power for factor in (1, 2, 5, 10) if factor * power >= least * (1 - 1e-12))
