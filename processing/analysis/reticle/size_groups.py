"""Which dot has which of the diameters that the maker of a reticle states."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from processing.errors import BadInput
from processing.geometry import FloatArray

LEAST_DOTS = 3
"""Of a diameter; fewer are dust."""
LEAST_RATIO = 1.08
"""Of two diameters: dots of closer ones could not be told apart."""
GAP_SHARE = 0.4
"""Of the least step between two diameters, as logarithms: a wider gap parts two sizes."""
IN_ANY_LIGHT, IN_ITS_LIGHT = (12.0, 0.2), (4.0, 0.03)
"""What a correction may be, in um and beside it of a diameter, where nobody knows the light, and where dots tell it, or
that none shows; more, and the diameters are those of another reticle."""


class ReticleError(BadInput):
    """Images do not show the reticle that was described; the text says what they show."""


def size_groups(
    found_um: FloatArray, diameters_um: Sequence[float], most: tuple[float, float] = IN_ANY_LIGHT
) -> NDArray[np.intp]:
    """Number of the stated diameter (N,) of every dot, -1 of dust.

    Dots are sorted by size. As many sizes must be seen as are stated: which of them is missing would be a guess.

    Parameters
    ----------
    found_um : (N,) array
        Diameters as they are seen, which may all be too large.
    diameters_um : sequence of float
        As the maker states them, increasing.
    most : float, float
        What a correction may be, in um and of a diameter.

    Raises
    ------
    ReticleError
        Diameters are too close, other sizes are seen than stated, or they lie too far from it.
    """
    steps = np.diff(np.log(diameters_um))
    if len(steps) and steps.min() < np.log(LEAST_RATIO):
        raise ReticleError(
            f"diameters of {', '.join(f'{one:g}' for one in diameters_um)} um: each must be at least "
            f"{LEAST_RATIO:g} times the one before, so that dots can be told apart"
        )
    gap = GAP_SHARE * (float(steps.min()) if len(steps) else np.log(2))
    order = np.argsort(found_um)
    cluster = np.cumsum(np.diff(np.log(found_um[order]), prepend=np.log(found_um[order[:1]])) > gap)
    sizes, counts = np.unique(cluster, return_counts=True)
    kept = sizes[counts >= LEAST_DOTS]
    medians_um = np.array([np.median(found_um[order][cluster == size]) for size in kept])
    _require_stated(medians_um, diameters_um, most)
    groups = np.full(len(found_um), -1, np.intp)
    for number, size in enumerate(kept):
        groups[order[cluster == size]] = number
    return groups


def _require_stated(seen_um: FloatArray, diameters_um: Sequence[float], most: tuple[float, float]) -> None:
    if not len(seen_um):
        raise ReticleError(
            f"no {LEAST_DOTS} dots of one size are seen in all views: is this the run of a reticle, is it wholly in "
            "every view, and is the calibration that of these views?"
        )
    seen = ", ".join(f"{one:.0f}" for one in seen_um)
    if len(seen_um) != len(diameters_um):
        raise ReticleError(
            f"{len(diameters_um)} diameters are stated, and dots of {len(seen_um)} sizes are seen, {LEAST_DOTS} of "
            f"each at least: about {seen} um; state the diameters of those, from the smallest to the largest, by "
            "--diameters"
        )
    for found_um, true_um in zip(seen_um.tolist(), diameters_um, strict=True):
        if abs(found_um - true_um) > most[0] + most[1] * true_um:
            raise ReticleError(
                f"dots of {true_um:g} um look as if they had {found_um:.0f} um: are these the diameters of this "
                f"reticle (sizes that are seen: about {seen} um), and is its calibration that of these views?"
            )
    _require_alike(seen_um - diameters_um, diameters_um)


def _require_alike(larger_um: FloatArray, diameters_um: Sequence[float]) -> None:
    """Light and blur displace edges, those of small and of large dots alike; a wrong scale does not."""
    for this_um, true_um in zip(larger_um.tolist(), diameters_um, strict=True):
        if abs(this_um - larger_um[0]) > IN_ITS_LIGHT[0] + IN_ITS_LIGHT[1] * true_um:
            raise ReticleError(
                f"dots of {diameters_um[0]:g} um look {larger_um[0]:+.0f} um larger, and those of {true_um:g} um "
                f"{this_um:+.0f} um: no light does that; are these the diameters of this reticle, and is the scale of "
                "the calibration right?"
            )
