"""ClockedSlabs: how long the slabs of a volume take to come, whatever is done in between; and whether all are empty."""

import time
from collections.abc import Iterator
from typing import Any

from numpy.typing import NDArray

from processing.reconstruction.slab_volume import Slabs


class ClockedSlabs:
    """Slabs, the seconds that they took to come, and whether no voxel so far has been above 0."""

    def __init__(self, slabs: Slabs) -> None:
        self._slabs = iter(slabs)
        self.seconds = 0.0
        self.empty = True

    def __iter__(self) -> Iterator[tuple[int, NDArray[Any]]]:
        return self

    def __next__(self) -> tuple[int, NDArray[Any]]:
        started_s = time.perf_counter()
        try:
            first_row, slab = next(self._slabs)
        finally:
            self.seconds += time.perf_counter() - started_s
        self.empty = self.empty and not slab.view(f"u{slab.itemsize}").any()
        return first_row, slab
