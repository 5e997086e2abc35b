"""Is a background that of its exposure? One that is flipped, or of another view, makes volumes that look fine.

What is left of the light when an exposure is divided by its background is even where no droplets are. If another image
leaves much less, the background is not its own.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from processing.preprocessing import Frame, Intensity

ASKED_PX = 10_000
"""About so many pixels of an image are asked, in even steps along rows and columns: light varies slowly."""
LIT = 0.05
"""Of the brightest light of a background."""
UNEVEN = 0.02
"""Median deviation of the light of an exposure from that of its background, relative to it: less does little harm.

A spray only takes light away; before a background that is not its own an exposure is brighter by as much somewhere."""
EVENER = 0.5
"""Of that deviation: another background that leaves no more is a better one."""
FEW = 100
"""Pixels tell nothing."""


def better_background(
    frame: Frame | Intensity,
    background: Intensity,
    dark: Intensity | None = None,
    others: Mapping[str, Intensity] | None = None,
) -> str:
    """Which background fits an exposure much better than the one that is given; empty where none does.

    Parameters
    ----------
    frame, background, dark : (rows, columns) array
        As for ``processing.preprocessing.intensity``.
    others : mapping of name to (rows, columns) array, optional
        Backgrounds that may be exchanged with this one; those of another shape are not asked.

    Returns
    -------
    str
        One of ``others``, or how the background is to be turned.
    """
    step = max(1, int(np.sqrt(frame.size / ASKED_PX)))
    coarse = np.s_[::step, ::step]
    below = np.float32(0) if dark is None else dark[coarse]
    light, full = (np.asarray(one[coarse] - below, np.float32) for one in (frame, background))
    left = _left(light, full)
    if left.size < FEW or (uneven := _unevenness(left)) < UNEVEN or np.percentile(left, 98) < 1 + uneven:
        return ""
    same_shape = {name: one for name, one in (others or {}).items() if one.shape == background.shape}
    choices = {
        "the same one upside down": background[::-1],
        "the same one with left and right exchanged": background[:, ::-1],
        "the same one turned by half": background[::-1, ::-1],
        **same_shape,
    }
    found = {name: _unevenness(_left(light, one[coarse] - below)) for name, one in choices.items()}
    best = min(found, key=lambda name: found[name])
    return best if found[best] <= EVENER * uneven else ""


def _left(light: NDArray[np.float32], full: NDArray[np.float32]) -> NDArray[np.float32]:
    """What is left of the light of a background, where it has any."""
    lit = full > LIT * full.max(initial=0)
    return np.asarray(light[lit] / full[lit], np.float32)


def _unevenness(left: NDArray[np.float32]) -> float:
    """Median deviation from the median, relative to it; infinite where that is nothing."""
    if left.size < FEW or (middle := float(np.median(left))) <= 0:
        return np.inf
    return float(np.median(np.abs(left - middle))) / middle
