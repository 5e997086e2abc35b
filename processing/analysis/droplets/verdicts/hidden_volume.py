"""Whether most of the volume could be measured."""

from processing.analysis.droplets.measured_exposure import MeasuredExposure, Rows, Seen

MOST_HIDDEN = 0.5
"""Share of the volume that may be hidden."""


def judged_by_volume(shot: MeasuredExposure[Rows, Seen]) -> MeasuredExposure[Rows, Seen]:
    """A shot, doubtful where most of its volume could not be measured."""
    if shot.hidden.volume_share <= MOST_HIDDEN:
        return shot
    share = f"{100 * shot.hidden.volume_share:.0f} % of the volume, limit {100 * MOST_HIDDEN:.0f} %"
    reason = (
        f"liquid that is no droplet hides {share}: measure farther from the nozzle (--grid)"
        if shot.hidden.liquid_objects
        else f"too few views see {share}: take a box that all of them see (--grid)"
    )
    return shot.doubted((reason,))
