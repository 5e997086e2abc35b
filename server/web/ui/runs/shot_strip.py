"""Which shots of a run are valid, as a coloured strip above its scrubber. Pure."""

from collections.abc import Sequence
from itertools import groupby, pairwise

_GOOD, _BAD = "#35b26a", "#e5484d"
MOST_STRIPES = 400
"""Thinner than a pixel, nobody sees them."""


def stripes(valid: Sequence[bool], most: int = MOST_STRIPES) -> list[tuple[float, float, bool]]:
    """Begin and end of each stripe as a share of the whole, and whether all of its shots are valid."""
    count = len(valid)
    if not count:
        return []
    edges = [round(number * count / min(count, most)) for number in range(min(count, most) + 1)]
    good = [all(valid[first:last]) for first, last in pairwise(edges)]
    told = []
    for is_good, group in groupby(range(len(good)), good.__getitem__):
        numbers = list(group)
        told.append((edges[numbers[0]] / count, edges[numbers[-1] + 1] / count, is_good))
    return told


def strip_style(valid: Sequence[bool]) -> str:
    """CSS of an element that shows them."""
    if not valid:
        return "background: none"
    stops = [
        f"{_GOOD if is_good else _BAD} {100 * first:.3f}% {100 * last:.3f}%" for first, last, is_good in stripes(valid)
    ]
    return f"background: linear-gradient(to right, {', '.join(stops)})"


def next_invalid(valid: Sequence[bool], after: int) -> int | None:
    """The next shot that is invalid, from the first one again after the last; None where all are valid."""
    bad = [index for index, is_good in enumerate(valid) if not is_good]
    return next((index for index in bad if index > after), bad[0] if bad else None)
