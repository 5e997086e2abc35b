"""Droplets of one image that are not as deep as the others: of another frame, or far out of focus.

Liquid makes sharp droplets as dark as their light lets them. Behind the round pupil of a lens one far out of focus is
as large as the pupil looks from there, with an edge hardly wider than that of others; it is pale, as it takes no more
light.
"""

import numpy as np

from processing.analysis.flat.flat_droplets import FlatDroplets

SHARP = 0.3
"""Blur over radius up to which a droplet is as deep in its middle as it is."""
FEWEST_ALIKE, LEAST_ALIKE = 5, 0.1
"""Of two kinds of droplets: how many, and which share, each has at least."""
LEAST_GAP, MOST_LARGER = 0.15, 1.4
"""Between the depths of both kinds, which is twice their own spread, too; and how much larger the ones are than the
others at most: bright particles of two sizes have two brightnesses."""
PALE, BLURRED = 0.75, 2.0
"""Of the depth of the deepest tenth: paler ones are no opaque discs; and of the blur of the others, which those far out
of focus have at least."""
MOST_WRONG, FEWEST_WRONG = 0.03, 3
"""So much larger may the mean diameter be than if light was kept; fewer than three are chance."""


def two_depths(found: FlatDroplets) -> str:
    """Sharp droplets are deep or pale, and nothing between: one spray in one light has no two kinds."""
    sharp = ~found.overlapping & (found.blur_px < SHARP * found.diameters_px / 2)
    depths, sizes_px = found.depths[sharp], found.diameters_px[sharp]
    pale = depths < (np.mean(np.quantile(depths, [0.05, 0.95])) if len(depths) else 0)
    if min(np.count_nonzero(pale), np.count_nonzero(~pale)) < max(FEWEST_ALIKE, LEAST_ALIKE * len(depths)):
        return ""
    (palest, pale_to), (deep_from, deepest) = (np.quantile(some, [0.1, 0.9]) for some in (depths[pale], depths[~pale]))
    larger = abs(np.log(np.median(sizes_px[pale]) / np.median(sizes_px[~pale])))
    apart = deep_from - pale_to >= max(LEAST_GAP, 2 * (pale_to - palest + deepest - deep_from))
    if not apart or larger > np.log(MOST_LARGER):
        return ""
    return (
        f"{np.count_nonzero(pale)} of {len(depths)} sharp droplets are {100 * np.median(depths[pale]):.0f} % deep, the "
        f"others {100 * np.median(depths[~pale]):.0f} %, and none between: are two frames blended, or reflected into "
        "one another? Droplets of both are counted"
    )


def out_of_focus(found: FlatDroplets) -> str:
    """Droplets that are blurred more than others, and paler than blur makes a disc: they are smaller than they look."""
    alone = ~found.overlapping & np.isfinite(found.blur_px)
    diameters_px, blur_px = found.diameters_px[alone], found.blur_px[alone]
    if not len(blur_px):
        return ""
    opaque = found.depths[alone] / -np.expm1(-0.5 * (diameters_px / (2 * np.maximum(blur_px, 1e-3))) ** 2)
    kept = opaque / np.quantile(opaque, 0.9)
    far = (kept < PALE) & (blur_px > BLURRED * np.median(blur_px[kept >= PALE]))
    larger = float(diameters_px.mean() / np.where(far, np.sqrt(kept) * diameters_px, diameters_px).mean()) - 1
    if np.count_nonzero(far) < FEWEST_WRONG or larger <= MOST_WRONG:
        return ""
    return (
        f"{np.count_nonzero(far)} of {len(far)} droplets are far out of focus behind a round pupil: paler than their "
        f"blur makes a disc, and larger than they are; D10 is about {100 * larger:.0f} % too large by them, limit "
        f"{100 * MOST_WRONG:.0f} %; stop the lens down, or let less depth of the spray be seen"
    )
