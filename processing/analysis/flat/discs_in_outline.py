"""Several discs that make one outline: droplets that overlap in the image."""

from dataclasses import dataclass

import cv2
import numpy as np

from processing.analysis.flat.outline import Outline

MOST_DISCS = 4
LEAST_COVER = 0.93
"""Share of the outline that the discs must explain: of a ligament they explain less."""
LEAST_RADIUS = 0.4
"""Of the largest: smaller ones are corners."""
FINER = 4
"""Pixels of the mask per pixel of the image."""


@dataclass(frozen=True)
class Disc:
    """A disc in an image.

    Parameters
    ----------
    row, column, radius_px : float
        Centre and radius.
    """

    row: float
    column: float
    radius_px: float


def discs_in(outline: Outline) -> list[Disc]:
    """The largest discs that find room in an outline one after the other; none where they do not explain it."""
    first = np.floor(outline.points.min(axis=0)) - 1
    scaled = (outline.points - first) * FINER
    mask = np.zeros(np.ceil(scaled.max(axis=0)).astype(int) + FINER, np.uint8)
    cv2.fillPoly(mask, [np.round(scaled[:, ::-1]).astype(np.int32)], 1)
    room = cv2.distanceTransform(mask, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    rows, columns = np.ogrid[: mask.shape[0], : mask.shape[1]]
    found: list[Disc] = []
    covered = np.zeros(mask.shape, bool)
    while len(found) < MOST_DISCS:
        free = np.where(covered, 0, room)
        row, column = np.unravel_index(int(np.argmax(free)), mask.shape)
        radius = float(free[row, column])
        if found and radius < LEAST_RADIUS * found[0].radius_px * FINER:
            break
        found.append(Disc(float(first[0]) + row / FINER, float(first[1]) + column / FINER, radius / FINER))
        covered |= (rows - row) ** 2 + (columns - column) ** 2 <= (1.05 * radius) ** 2
    explained = np.count_nonzero(covered & (mask > 0)) >= LEAST_COVER * np.count_nonzero(mask)
    return found if len(found) > 1 and explained else []
