"""Droplets of one image whose edges are as soft as they are large: balls that shine or let light pass, no discs.

A lens blurs small and large droplets alike, or each by how deep it lies. Where blur goes with the diameter, and hardly
anything else changes it, edges are the droplets' own: a ball that shines throughout is as bright as it is deep, and
half of that lies at 0.87 radii.
"""

import numpy as np

from processing.analysis.flat.flat_droplets import FlatDroplets

FEWEST, LEAST_SPREAD = 10, 0.1
"""Droplets, and standard deviation of the logarithms of their diameters, that tell how blur goes with the diameter."""
LEAST_POWER, LEAST_TOLD, MOST_REST = 0.35, 0.75, 0.25
"""Power of the diameter that blur goes with, share of its scatter that this explains, and standard deviation of the
logarithm that it leaves: discs have a power of 0.05, with a glare in their middle up to 0.29; at all depths a half of
their scatter is explained, and 0.5 left. Balls have 0.38 to 0.75, 0.85 and 0.1."""


def soft_edges(found: FlatDroplets) -> str:
    """Blur goes with the diameter: outlines at half of the depth lie within the droplets."""
    alone = ~found.overlapping & (found.blur_px > 0)
    sizes, blurs = np.log(found.diameters_px[alone]), np.log(found.blur_px[alone])
    if len(sizes) < FEWEST or np.std(sizes) < LEAST_SPREAD or np.ptp(blurs) == 0:
        return ""
    power, told = np.cov(sizes, blurs)[0, 1] / np.var(sizes, ddof=1), np.corrcoef(sizes, blurs)[0, 1] ** 2
    if power < LEAST_POWER or told < LEAST_TOLD or (1 - told) * np.var(blurs) > MOST_REST**2:
        return ""
    softest = np.median(2 * found.blur_px[alone] / found.diameters_px[alone])
    return (
        f"edges of {len(sizes)} droplets are the softer the larger they are (by the power {power:.2f} of the diameter, "
        f"limit {LEAST_POWER:g}), {100 * softest:.0f} % of their radius, and hardly otherwise: no lens does that. They "
        "shine throughout, or let light pass at the edge, and half of their depth lies 5 to 15 % within it"
    )
