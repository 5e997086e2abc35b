"""Are the droplets of exposure B as large as the very same ones in A? Of which both know the diameter.

Nothing but both exposures tells it: a faint light from elsewhere, a pulse that is longer than the other, or a second
one make diameters smaller and leave hardly a trace in one exposure by itself.
"""

import math

import numpy as np

from processing.analysis.droplets.droplet_table import DropletRows, SizedDroplets
from processing.analysis.velocity.measured_velocities import MeasuredVelocities
from processing.geometry import FloatArray

LEAST_UNLIKE, SURE = 0.01, 5.0
"""Of the diameter, by which a median droplet is larger or smaller, and standard deviations by which that is known."""
COMMON_SIGMAS, SUREST = 2.0, 10.0
"""Standard deviations of what all diameters of an exposure share, as the light that was found in it; no droplet is
known better, so that percent of the droplets whose diameters are known best tells them."""
LEAST_P_PAIR, FEWEST = 0.9, 10
"""Of the partners, and how many of them it takes."""
LONGEST_NS = 1e6
"""From A to B: in a longer time droplets may evaporate."""


def unlike_sizes(first: DropletRows, second: DropletRows, velocities: MeasuredVelocities) -> str:
    """What is wrong with the diameters of one of two exposures; empty where nothing says so.

    Parameters
    ----------
    first, second : SizedDroplets
        Of A, and of B; of others nothing is said.
    velocities : MeasuredVelocities
        Theirs: which droplet of B is which one of A.
    """
    if not (isinstance(first, SizedDroplets) and isinstance(second, SizedDroplets)):
        return ""
    partners = velocities.first.partners
    (own,) = np.nonzero((partners.partner >= 0) & (partners.p_pair > LEAST_P_PAIR))
    if len(own) < FEWEST or velocities.separation_ns > LONGEST_NS:
        return ""
    before_um, after_um = first.diameters_um[own], second.diameters_um[partners.partner[own]]
    shares = (common_share(one.diameter_sd_um, one.diameters_um) for one in (first, second))
    return unlike_told(before_um, after_um, math.hypot(*shares), velocities.separation_ns)


def unlike_told(before_um: FloatArray, after_um: FloatArray, common: float, separation_ns: float) -> str:
    """What is wrong with diameters of the very same droplets in A and in B; empty where nothing says so.

    Parameters
    ----------
    before_um, after_um : (N,) arrays
        In A, and in B.
    common : float
        Standard deviation that all ratios share.
    separation_ns : float
        From A to B.
    """
    growth = _growth(np.log(after_um / before_um), LEAST_UNLIKE + COMMON_SIGMAS * common)
    if not growth:
        return ""
    return (
        f"the very same droplets are {100 * abs(np.expm1(growth)):.1f} % {'larger' if growth > 0 else 'smaller'} in "
        f"exposure B than in A, {separation_ns / 1000:.3g} us before: diameters of one of them are wrong. "
        "Has each its own dark image and background, are both pulses as long, and is there no light besides?"
    )


def common_share(sd_um: FloatArray, diameters_um: FloatArray) -> float:
    """Standard deviation that all diameters of an exposure share, relative: that of those which are known best."""
    return float(np.percentile(sd_um / diameters_um, SUREST))


def _growth(changes: FloatArray, allowed: float) -> float:
    """Median change, or 0 where it is no more than is allowed, or may be chance."""
    middle = float(np.median(changes))
    sd = 1.4826 * float(np.median(np.abs(changes - middle))) * np.sqrt(np.pi / 2 / len(changes))
    return middle if abs(middle) > allowed + SURE * sd else 0.0
