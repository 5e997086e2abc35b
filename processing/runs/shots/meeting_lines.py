"""At how many droplets lines of sight meet: asked of every shot, as a view may have moved for a few shots alone.

It is asked of some droplets in the middle of the volume, which costs a hundredth of a second. Where they meet much more
seldom than in the other shots of a run, all droplets are asked (``check_shot``); this here is no verdict.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from processing.calibration.calibration import Calibration
from processing.calibration.droplets.disparity import MIN_VIEWS, measured_box
from processing.calibration.droplets.droplet_images import find_droplets
from processing.calibration.droplets.droplet_matching import Box, match_droplets
from processing.geometry import ViewMapping
from processing.preprocessing import Intensity

SEEDS = 100
"""Droplets of one view that are followed."""
MIDDLE = 0.5
"""Of the measured volume, along x, y and z."""
CLOSE_PX = 1.0
"""Lines of sight that pass a droplet so closely, in all images, meet there."""
SELDOM = 0.5
"""Of how often they meet in half of the shots."""
SURE = 3.0
"""Standard deviations of the count that is missed."""
MOST_ODD = 3
"""Shots that are then asked in full."""


@dataclass(frozen=True, eq=False)
class MeetingLines:
    """Where to look for some droplets of a shot, and how to follow them.

    Parameters
    ----------
    mappings : sequence of ViewMapping
        The views, in the order of the images.
    box : Box
        The measured volume.
    parts : sequence of (slice, slice)
        Rows and columns of each image that see its middle.
    """

    mappings: Sequence[ViewMapping]
    box: Box
    parts: Sequence[tuple[slice, slice]]

    @classmethod
    def of(cls, calibration: Calibration, views: Sequence[str]) -> "MeetingLines | None":
        """For these views; None where they are too few for lines of sight to meet otherwise than by chance.

        Raises
        ------
        CalibrationError
            A view is not in the calibration or was refused, or the calibration has no common world.
        """
        calibration.require_usable(views)
        if len(views) < MIN_VIEWS:
            return None
        mappings = [calibration.views[name].mapping for name in views]
        box = measured_box(calibration)
        return cls(mappings, box, [_part(mapping, box) for mapping in mappings])

    def count(self, images: Sequence[Intensity]) -> int:
        """At how many droplets of an exposure lines of sight of all views meet; none in images of another size."""
        sizes_px = [image.shape[::-1] for image in images]
        if sizes_px != [mapping.image_size_px for mapping in self.mappings]:
            return 0
        droplets_px = [
            find_droplets(image[part]) + (part[1].start, part[0].start)
            for image, part in zip(images, self.parts, strict=True)
        ]
        if not all(map(len, droplets_px)):
            return 0
        return len(match_droplets(self.mappings, droplets_px, self.box, CLOSE_PX, SEEDS))


@dataclass(frozen=True, eq=False)
class SeldomMeeting:
    """Looks at the exposures of shot after shot, and knows in which of them lines of sight meet seldom.

    Parameters
    ----------
    lines : MeetingLines, optional
        Without, no shot stands out.
    counts : dict of int to int
        By shot: at how many droplets lines of sight meet, in the exposure where these are fewer.
    """

    lines: MeetingLines | None
    counts: dict[int, int] = field(default_factory=dict)

    def look(self, shot: int, images: Sequence[Intensity]) -> None:
        """Count in one exposure."""
        if self.lines:
            count = self.lines.count(images)
            self.counts[shot] = min(count, self.counts.get(shot, count))

    def shots(self) -> list[int]:
        """Shots in which they meet much more seldom than in the others; the most seldom first, no more than a few."""
        usual = float(np.median(list(self.counts.values()))) if self.counts else 0.0
        least = min(SELDOM * usual, usual - SURE * np.sqrt(usual))
        odd = [shot for shot, count in self.counts.items() if count < least]
        return sorted(odd, key=lambda shot: self.counts[shot])[:MOST_ODD]


def _part(mapping: ViewMapping, box: Box) -> tuple[slice, slice]:
    """Rows and columns that hold the middle of a box as a view sees it."""
    half_mm = MIDDLE / 2 * (np.array(box.upper_mm) - np.array(box.lower_mm))
    corners_mm = box.middle_mm + half_mm * np.array(list(product((-1, 1), repeat=3)))
    seen_px = mapping.project(corners_mm)
    width, height = mapping.image_size_px
    left, top = np.clip(np.floor(seen_px.min(axis=0)), 0, (width - 1, height - 1)).astype(int)
    right, bottom = np.clip(np.ceil(seen_px.max(axis=0)), 1, (width, height)).astype(int)
    return slice(top, max(bottom, top + 1)), slice(left, max(right, left + 1))
