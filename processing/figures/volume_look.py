"""VolumeLook: what the figure of a volume shows, gathered slab by slab, so that no volume has to lie in memory."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.reconstruction.slab_volume import Slabs

Plane = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class VolumeLook:
    """Slices and projections of a volume, each along z, y, x.

    Parameters
    ----------
    fullest : tuple of int
        The planes with the largest sum.
    slices, projections : tuple of (rows, columns) float32 arrays
        Those planes, and the maxima across all planes.
    """

    fullest: tuple[int, int, int]
    slices: tuple[Plane, Plane, Plane]
    projections: tuple[Plane, Plane, Plane]


class GrowingLook:
    """The look of a volume (nz, ny, nx) of values from 0 on, of which one slab is seen after the other."""

    def __init__(self, shape: tuple[int, int, int]) -> None:
        nz, ny, nx = self._shape = shape
        self._projections = (_zeros(ny, nx), _zeros(nz, nx), _zeros(nz, ny))
        self._sums, self._sum_along_z = np.zeros(nz), _zeros(ny, nx)

    def watching(self, slabs: Slabs) -> Iterator[tuple[int, Plane]]:
        """The same slabs, seen as they pass."""
        for first_row, slab in slabs:
            self._see(slice(first_row, first_row + slab.shape[1]), slab)
            yield first_row, slab

    def _see(self, rows: slice, slab: Plane) -> None:
        along_z, along_y, along_x = self._projections
        highest, above = along_z[rows].view(np.int32), along_y.view(np.int32)
        for z, plane in enumerate(slab):  # one by one: a plane of a slab fits into the cache
            bits = np.asarray(plane, np.float32).view(np.int32)  # from 0 on in the order of values, compared faster
            np.maximum(highest, bits, out=highest)
            np.maximum(above[z], bits.max(axis=0), out=above[z])
            along_x[z, rows] = cv2.reduce(plane, 1, cv2.REDUCE_MAX)[:, 0]  # twice as fast as numpy
            self._sum_along_z[rows] += plane
            self._sums[z] += cv2.sumElems(plane)[0]

    def look(self, plane: Callable[[int, int], Plane]) -> VolumeLook:
        """What has been seen, and the slices that show most of it; ``plane(axis, index)`` makes them, axis 0 is z."""
        sums = (self._sums, self._sum_along_z.sum(axis=1), self._sum_along_z.sum(axis=0))
        z, y, x = (int(one.argmax()) for one in sums)
        return VolumeLook((z, y, x), (plane(0, z), plane(1, y), plane(2, x)), self._projections)


def _zeros(rows: int, columns: int) -> Plane:
    return np.zeros((rows, columns), np.float32)
