"""Spots of an image: what stands out of its surroundings, found by components at falling levels of darkness."""

from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

LEVELS = 16
"""From the darkest to the faintest."""


@dataclass(frozen=True)
class Spot:
    """A peak of darkness with what belongs to it.

    Parameters
    ----------
    row, column : int
        Its darkest pixel.
    peak : float
        Darkness there.
    base : float
        The lowest level at which it is alone: below, it is one with another spot, or is none. 0 where it is alone at
        the faintest level that is looked at.
    box : 4 ints
        First row, first column, rows and columns of its component at that level.
    """

    row: int
    column: int
    peak: float
    base: float
    box: tuple[int, int, int, int]


def find_spots(values: NDArray[np.float32], least: float, height: float) -> list[Spot]:
    """Spots, the darkest first.

    Parameters
    ----------
    values : (rows, columns) float32 array
        Darkness, smoothed.
    least : float
        The faintest level that is looked at.
    height : float
        So much a spot must be darker than the saddle to a darker one.
    """
    top = float(values.max())
    growing: list[Spot] = []
    grown: list[Spot] = []
    for level in np.linspace(max(top - 0.5 * height, least), least, LEVELS) if top > least else ():
        growing, ended = _flooded(values, float(level), height, growing, grown)
        grown += ended
    alone = [replace(spot, base=0.0) for spot in growing]
    return sorted((spot for spot in alone + grown if spot.peak - spot.base >= height), key=lambda spot: -spot.peak)


def _flooded(
    values: NDArray[np.float32], level: float, height: float, growing: list[Spot], grown: list[Spot]
) -> tuple[list[Spot], list[Spot]]:
    """Spots that grow on at a level, and those that have met another as tall as a spot must be; less are absorbed.

    How tall one is its last level alone says: what is told of it then.
    """
    mask = (values > level).astype(np.uint8)
    count, labels, boxes, _ = cv2.connectedComponentsWithStats(mask, connectivity=8, ltype=cv2.CV_32S)
    met = {int(labels[spot.row, spot.column]) for spot in grown}
    members: dict[int, list[Spot]] = {}
    for spot in growing:
        members.setdefault(int(labels[spot.row, spot.column]), []).append(spot)
    still, ended = [], []
    for label, spots in members.items():
        tall = [spot for spot in spots if spot.peak - spot.base >= height]
        if label in met or len(tall) > 1:
            ended += tall
        else:
            still.append(replace(max(spots, key=lambda spot: spot.peak), base=level, box=_box(boxes[label])))
    new = set(range(1, count)) - met - members.keys()
    return still + [_new(values, labels, label, _box(boxes[label]), level) for label in new], ended


def _new(
    values: NDArray[np.float32], labels: NDArray[Any], label: int, box: tuple[int, int, int, int], level: float
) -> Spot:
    first_row, first_column, rows, columns = box
    part = (slice(first_row, first_row + rows), slice(first_column, first_column + columns))
    inside = np.where(labels[part] == label, values[part], -np.inf)
    row, column = np.unravel_index(int(np.argmax(inside)), inside.shape)
    return Spot(first_row + int(row), first_column + int(column), float(inside.max()), level, box)


def _box(stats: NDArray[Any]) -> tuple[int, int, int, int]:
    left, top, width, height = (int(value) for value in stats[:4])
    return top, left, height, width
