"""Are the droplets of exposure B as large as the very same ones in A? Of which both know the diameter.

Nothing but both exposures tells it: a faint light from elsewhere, a pulse that is longer than the other, or a second
one make diameters smaller and leave hardly a trace in one exposure by itself.
"""

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
    before, after = first.diameters_um[own], second.diameters_um[partners.partner[own]]
    common = np.hypot(_common(first), _common(second))
    growth = _growth(np.log(after / before), LEAST_UNLIKE + COMMON_SIGMAS * float(common))
    if not growth:
        return ""
    return (
        f"the very same droplets are {100 * abs(np.expm1(growth)):.1f} % {'larger' if growth > 0 else 'smaller'} in "
        f"exposure B than in A, {velocities.separation_ns / 1000:.3g} us before: diameters of one of them are wrong. "
        "Has each its own dark image and background, are both pulses as long, and is there no light besides?"
    )


def _common(droplets: SizedDroplets) -> float:
    return float(np.percentile(droplets.diameter_sd_um / droplets.diameters_um, SUREST))


def _growth(changes: FloatArray, allowed: float) -> float:
    """Median change, or 0 where it is no more than is allowed, or may be chance."""
    middle = float(np.median(changes))
    sd = 1.4826 * float(np.median(np.abs(changes - middle))) * np.sqrt(np.pi / 2 / len(changes))
    return middle if abs(middle) > allowed + SURE * sd else 0.0
