"""Whether what is told is probable: ghosts may explain the images to their noise."""

import numpy as np

from processing.analysis.droplets.measured_exposure import MeasuredExposure, Rows, Seen

MOST_GHOSTS = 0.2
"""Share of the droplets that may be expected to be ghosts. In simulated shots of any noise and density that was tried
it is up to 0.08; glow that is not smooth, and makes ghosts, has 0.3 to 0.5."""


def judged_by_probability(shot: MeasuredExposure[Rows, Seen]) -> MeasuredExposure[Rows, Seen]:
    """A shot, doubtful where too many of its droplets are improbable; it says nothing where that is not known."""
    known = shot.droplets.p_real[np.isfinite(shot.droplets.p_real)]
    if not len(known) or (share := float(np.mean(1 - known))) <= MOST_GHOSTS:
        return shot
    reason = (
        f"of {len(known)} droplets {100 * share:.0f} % are expected to be ghosts, limit {100 * MOST_GHOSTS:.0f} %: is "
        "there light that is of no droplet, as scattered light that varies within 50 pixels, or too much noise?"
    )
    return shot.doubted((reason,))
