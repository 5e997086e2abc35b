"""Whether views see shadows that no droplet explains.

They are those of droplets that another view does not see, as in a band that shows its background alone.
"""

from collections.abc import Sequence

import cv2
import numpy as np

from processing.analysis.droplets.gaussian_blobs import Image
from processing.analysis.droplets.measured_exposure import MeasuredExposure, Rows, Seen

DEEP, SIGMAS, PIXELS = 0.25, 6.0, 4
"""Share of the light, standard deviations of a pixel's noise, and pixels that touch: a shadow that nobody overlooks."""
FEW, MOST_UNEXPLAINED = 1, 0.05
"""Such shadows that tell nothing, and share of the droplets that they may be. In simulated shots of 12 to 300 droplets
there is one at most."""


def unexplained_shadows(images: Sequence[Image], drawn: Sequence[Image], weights: Sequence[Image]) -> list[int]:
    """How many shadows of each view no droplet explains.

    Parameters
    ----------
    images, drawn : sequence of (rows, columns) float32 arrays
        Transmissions as they were seen, and as droplets explain them.
    weights : sequence of (rows, columns) float32 arrays
        Inverse variances of the pixels; 0 where they are not asked.
    """
    return [_dark_spots(*view) for view in zip(images, drawn, weights, strict=True)]


def _dark_spots(image: Image, drawn: Image, weight: Image) -> int:
    left = drawn - image
    dark = (left > DEEP) & (left * np.sqrt(weight) > SIGMAS)
    _, _, spots, _ = cv2.connectedComponentsWithStats(dark.astype(np.uint8))
    return int(np.count_nonzero(spots[1:, cv2.CC_STAT_AREA] >= PIXELS))


def judged_by_unexplained(shot: MeasuredExposure[Rows, Seen], counts: Sequence[int]) -> MeasuredExposure[Rows, Seen]:
    """A shot, doubtful where a view sees too many shadows, by ``counts`` of each, that are of no droplet."""
    name, count = max(zip(shot.views, counts, strict=True), key=lambda one: one[1])
    if count <= max(FEW, MOST_UNEXPLAINED * len(shot.droplets)):
        return shot
    reason = (
        f"{name} sees {count} dark shadows that are of none of the {len(shot.droplets)} droplets, limit "
        f"{100 * MOST_UNEXPLAINED:.0f} %: does another view see nothing there, as where a part of its image is its "
        "background, or is there liquid that is no droplet? Droplets are missing then"
    )
    return shot.doubted((reason,))
