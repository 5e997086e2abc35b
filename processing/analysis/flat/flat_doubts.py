"""Why mean diameters of single images are not those of the spray: what was seen and not measured, and what overlaps."""

import numpy as np

from processing.analysis.flat.flat_droplets import FlatDroplets
from processing.analysis.flat.soft_edges import soft_edges
from processing.analysis.flat.unlike_depths import out_of_focus, two_depths
from processing.geometry import FloatArray

MOST_CROWDED, FEWEST_CROWDED = 0.2, 5
"""Share of the shadows that may overlap others, or be no discs; fewer than five are chance. Of simulated sprays of 14
to 30 px with 20 % of them D32 is 2 to 4 % wrong, with 30 to 55 % up to 9 %: two look like one, large ones are lost."""
MOST_SATURATED = 0.05
"""Of the bright particles."""
LEAST_MEASURED = 0.5
"""Of the droplets that are seen whole: of fewer, means are those of a choice that size and sharpness have made."""
MOST_LARGER, FEWEST_LACKING = 0.03, 3
"""So much larger than that of all may the mean diameter of those be that are measured; fewer lacking ones are dust."""

MOST_LEFT, MOST_UNLIKE, FEWEST_UNLIKE = 0.08, 0.1, 3
"""Of its depth a blurred disc may leave so much at the edge of a droplet: sharp, noisy, compressed and flattened ones
leave 0.06 at most, rings that are 3 % too large 0.07 to 0.12. So many may be otherwise; fewer than three are chance."""


def flat_doubts(found: FlatDroplets) -> list[str]:
    """Why means of an image are not those of the spray."""
    overlapping = int(np.count_nonzero(found.overlapping))
    doubts = (
        _unmeasured(found) or chosen_by_size(found.diameters_px, found.lacking_px),
        _saturated(found),
        no_discs(found.edge_residuals),
        soft_edges(found),
        two_depths(found),
        out_of_focus(found),
        crowded(overlapping, found.left_out.get("not_round", 0), len(found)),
    )
    return [doubt for doubt in doubts if doubt]


def chosen_by_size(measured_px: FloatArray, lacking_px: FloatArray) -> str:
    """Mostly small droplets are too small, too faint, or not sharp enough, to be sized: means are of the others.

    Parameters
    ----------
    measured_px, lacking_px : (N,), (M,) array
        Diameters of droplets that are measured, and about those of the others that are seen.
    """
    if len(lacking_px) < FEWEST_LACKING or not len(measured_px):
        return ""
    larger = float(measured_px.mean() / np.concatenate([measured_px, lacking_px]).mean()) - 1
    if larger <= MOST_LARGER:
        return ""
    return (
        f"{len(lacking_px)} of {len(lacking_px) + len(measured_px)} droplets are unsharp, too small or too faint to be "
        f"sized, and mostly small ones: D10 is about {100 * larger:.0f} % too large for what is seen, limit "
        f"{100 * MOST_LARGER:.0f} %; focus, take shorter pulses or more magnification"
    )


def no_discs(edge_residuals: FloatArray) -> str:
    """Blurred discs are not what droplets look like at their edges: nor are their diameters.

    Parameters
    ----------
    edge_residuals : (N,) array
        As in ``FlatDroplets``.
    """
    known = edge_residuals[np.isfinite(edge_residuals)]
    unlike = known[known > MOST_LEFT]
    if len(unlike) < FEWEST_UNLIKE or len(unlike) <= MOST_UNLIKE * len(known):
        return ""
    return (
        f"{len(unlike)} of {len(known)} droplets, limit {100 * MOST_UNLIKE:.0f} %, are no blurred discs: these leave "
        f"{100 * np.median(unlike):.0f} % of their depth at edges, limit {100 * MOST_LEFT:.0f} %, and diameters may be "
        "5 to 40 % wrong; are they bubbles or rings, two droplets that look like one, or was a threshold set, the "
        "image sharpened, or grey values made few?"
    )


def _unmeasured(found: FlatDroplets) -> str:
    """Most of what is seen whole was not measured."""
    lacking = {reason: number for reason, number in found.left_out.items() if reason != "border"}
    seen = len(found) + sum(lacking.values())
    if len(found) >= LEAST_MEASURED * seen:
        return ""
    why = ", ".join(f"{number} {reason.replace('_', ' ')}" for reason, number in lacking.items())
    return f"{len(found)} of {seen} shadows are measured ({why}): means are of those, not of the spray"


def _saturated(found: FlatDroplets) -> str:
    """Bright particles are left out as nobody knows how bright they are: hardly the smallest ones."""
    lacking, seen = found.left_out.get("saturated", 0), len(found) + found.left_out.get("saturated", 0)
    if lacking <= MOST_SATURATED * seen:
        return ""
    return (
        f"{lacking} of {seen} particles, limit {100 * MOST_SATURATED:.0f} %, are at the camera's full scale and not "
        "measured: where they are half as bright is unknown, and means are of the fainter ones; take less light"
    )


def crowded(overlapping: int, clumps: int, measured: int) -> str:
    """Shadows lie over one another: so many were told apart, and of so many clumps nobody knows what they hold."""
    crowd, seen = overlapping + clumps, measured + clumps
    if crowd < FEWEST_CROWDED or crowd <= MOST_CROWDED * seen:
        return ""
    return (
        f"{crowd} of {seen} shadows, limit {100 * MOST_CROWDED:.0f} %, overlap others or are no discs ({clumps} are "
        "left out, each of which may hold several droplets): two that lie over each other look like one, large ones "
        "are lost, and means may be 10 % wrong; measure farther from the nozzle, or with less depth"
    )
