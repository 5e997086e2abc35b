"""At how many droplets lines of sight meet: asked of every shot, as a view may have moved for a few shots alone.

It is asked of some droplets in the middle of the volume, which costs a hundredth of a second. Where they meet much more
seldom than in the other shots of a run, all droplets are asked (``check_shot``); this here is no verdict.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from processing.calibration.calibration import Calibration
from processing.calibration.droplets.disparity import MIN_VIEWS, measured_box
from processing.calibration.droplets.droplet_images import find_droplets
from processing.calibration.droplets.droplet_matching import Box, Matches, match_droplets
from processing.geometry import FloatArray, ViewMapping
from processing.preprocessing import Intensity
from processing.runs.shots.meetings import Meeting

SEEDS = 100
"""Droplets of one view that are followed."""
MIDDLE = 0.5
"""Of the measured volume, along x, y and z."""
CLOSE_PX = 1.0
"""Lines of sight that pass a droplet so closely, in all images, meet there."""
_AROUND = np.array([-1, 0, 1])


@dataclass(frozen=True, eq=False)
class MeetingLines:
    """Where to look for some droplets of a shot, and how to follow them.

    Parameters
    ----------
    views : sequence of str
        Their names, in the order of the images.
    mappings : sequence of ViewMapping
        Of these views.
    box : Box
        The measured volume.
    parts : sequence of (slice, slice)
        Rows and columns of each image that see its middle.
    """

    views: Sequence[str]
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
        return cls(views, mappings, box, [_part(mapping, box) for mapping in mappings])

    def meeting(self, images: Sequence[Intensity]) -> Meeting:
        """At how many droplets of an exposure lines of sight of all views meet; none in images of another size."""
        sizes_px = [image.shape[::-1] for image in images]
        if sizes_px != [mapping.image_size_px for mapping in self.mappings]:
            return Meeting(droplets=0)
        droplets_px = [
            find_droplets(image[part]) + (part[1].start, part[0].start)
            for image, part in zip(images, self.parts, strict=True)
        ]
        if not all(map(len, droplets_px)):
            return Meeting(droplets=0)
        matches = match_droplets(self.mappings, droplets_px, self.box, CLOSE_PX, SEEDS)
        return self._shown(images, matches) if len(matches) else Meeting(droplets=0)

    def _shown(self, images: Sequence[Intensity], matches: Matches) -> Meeting:
        seen = zip(images, self.mappings, np.moveaxis(matches.disparities_px, 1, 0), strict=True)
        peaks = np.stack([_peaks(image, one.project(matches.points_mm) + beside_px) for image, one, beside_px in seen])
        lower, upper = np.percentile(peaks / np.median(peaks, axis=0), (25, 75), axis=1)
        errors = (upper - lower) / np.sqrt(len(matches))  # of the quartile of a normal distribution
        contrasts, by_chance = (dict(zip(self.views, one.round(4).tolist(), strict=True)) for one in (lower, errors))
        return Meeting(droplets=len(matches), contrasts=contrasts, errors=by_chance)


def _peaks(image: Intensity, centres_px: FloatArray) -> FloatArray:
    """The highest pixel (N,) around each of some places."""
    columns, rows = np.rint(centres_px).astype(int).T
    height, width = image.shape
    down = np.clip(rows[:, None, None] + _AROUND[:, None], 0, height - 1)
    along = np.clip(columns[:, None, None] + _AROUND, 0, width - 1)
    return np.asarray(image[down, along].max(axis=(1, 2)), np.float64)


def _part(mapping: ViewMapping, box: Box) -> tuple[slice, slice]:
    """Rows and columns that hold the middle of a box as a view sees it."""
    half_mm = MIDDLE / 2 * (np.array(box.upper_mm) - np.array(box.lower_mm))
    corners_mm = box.middle_mm + half_mm * np.array(list(product((-1, 1), repeat=3)))
    seen_px = mapping.project(corners_mm)
    width, height = mapping.image_size_px
    left, top = np.clip(np.floor(seen_px.min(axis=0)), 0, (width - 1, height - 1)).astype(int)
    right, bottom = np.clip(np.ceil(seen_px.max(axis=0)), 1, (width, height)).astype(int)
    return slice(top, max(bottom, top + 1)), slice(left, max(right, left + 1))
