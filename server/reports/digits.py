"""How many digits a number is told with."""

from math import floor, log10

NARROW, NONE = 0.01, 1e-9
"""Of the number: half of an interval that three digits do not show, and of one that is none but for rounding."""
WRITTEN_OUT = 1e6
"""Smaller numbers have no exponent."""


def three_digits(value: float) -> str:
    """No more than a figure with an interval bears, and zeros at the end where they are known."""
    told = f"{value:#.3g}".rstrip(".")
    return f"{float(told):.0f}" if "e+" in told and abs(value) < WRITTEN_OUT else told


def digits_of_interval(value: float, low: float, high: float) -> tuple[str, str, str]:
    """A number and its limits: three digits each, or as many as tell two of half the interval where it is narrow."""
    half = (high - low) / 2
    if not NONE * abs(value) < half < NARROW * abs(value):
        return three_digits(value), three_digits(low), three_digits(high)
    decimals = max(0, 1 - floor(log10(half)))
    return f"{value:.{decimals}f}", f"{low:.{decimals}f}", f"{high:.{decimals}f}"
