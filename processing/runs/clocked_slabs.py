"""ClockedSlabs: how long the slabs of a volume take to come, whatever is done with them in between."""

import time
from collections.abc import Iterator
from typing import Any

from numpy.typing import NDArray

from processing.reconstruction.slab_volume import Slabs


class ClockedSlabs:
    """Slabs, and the seconds that they took to come."""

    def __init__(self, slabs: Slabs) -> None:
        self._slabs = iter(slabs)
        self.seconds = 0.0

    def __iter__(self) -> Iterator[tuple[int, NDArray[Any]]]:
        return self

    def __next__(self) -> tuple[int, NDArray[Any]]:
        started_s = time.perf_counter()
        try:
            return next(self._slabs)
        finally:
            self.seconds += time.perf_counter() - started_s
