"""Outlines of dark spots at a level, to a fraction of a pixel."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from skimage.measure import find_contours

from processing.geometry import FloatArray


@dataclass(frozen=True, eq=False)
class Outline:
    """A closed line of equal darkness.

    Parameters
    ----------
    points : (N, 2) array
        Row and column; the last is the first.
    """

    points: FloatArray

    @property
    def area_px2(self) -> float:
        """Area within, holes included."""
        row, column = self.points.T
        return 0.5 * abs(float(np.sum(row[:-1] * column[1:] - row[1:] * column[:-1])))

    @property
    def perimeter_px(self) -> float:
        """Length, of a line through every second point: single pixels of noise lengthen it."""
        coarse = np.concatenate([self.points[:-1:2], self.points[:1]])
        return float(np.linalg.norm(np.diff(coarse, axis=0), axis=1).sum())

    @property
    def circularity(self) -> float:
        """4 pi area over perimeter squared: 1 for a circle."""
        perimeter_px = self.perimeter_px
        return 4 * np.pi * self.area_px2 / perimeter_px**2 if perimeter_px else 0.0

    @property
    def radius_px(self) -> float:
        """Of a circle as large."""
        return float(np.sqrt(self.area_px2 / np.pi))

    @property
    def centre_px(self) -> tuple[float, float]:
        """Row and column of the centre of the area."""
        row, column = self.points.T
        cross = row[:-1] * column[1:] - row[1:] * column[:-1]
        total = float(cross.sum())
        return (
            float(((row[:-1] + row[1:]) * cross).sum()) / (3 * total),
            float(((column[:-1] + column[1:]) * cross).sum()) / (3 * total),
        )

    @property
    def stretch(self) -> FloatArray:
        """Matrix (2, 2), rows first, that makes the ellipse of its second moments a circle as large."""
        moments = cv2.moments(self.points[:, None, ::-1].astype(np.float32))
        spread = np.array([[moments["mu02"], moments["mu11"]], [moments["mu11"], moments["mu20"]]])
        squares, axes = np.linalg.eigh(spread)
        lengths = np.sqrt(np.maximum(squares, 1e-9))
        return np.asarray((axes * (np.sqrt(lengths.prod()) / lengths)) @ axes.T)


def outline_around(values: NDArray[np.float32], level: float, inside: tuple[int, int]) -> Outline | None:
    """The outermost outline at a level around a pixel; None where it leaves the image.

    Parameters
    ----------
    values : (rows, columns) array
        Darkness.
    level : float
        Of the line.
    inside : int, int
        Row and column of a pixel above the level.
    """
    _, labels, boxes, _ = cv2.connectedComponentsWithStats((values > level).astype(np.uint8), connectivity=8)
    label = labels[inside]
    left, top, width, height, _ = (int(value) for value in boxes[label])
    rows, columns = values.shape
    if label == 0 or left < 1 or top < 1 or left + width >= columns or top + height >= rows:
        return None
    part = (slice(top - 1, top + height + 1), slice(left - 1, left + width + 1))
    alone = np.where((labels[part] == label) | (values[part] <= level), values[part], level)
    points = max((points for points in _contours(alone, level)), key=len)
    return Outline(points + (top - 1, left - 1))


def _contours(values: NDArray[np.float32], level: float) -> list[FloatArray]:
    found: list[FloatArray] = find_contours(values, level)  # type: ignore[no-untyped-call]
    return found
