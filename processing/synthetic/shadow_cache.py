"""ShadowCache: rendered transmittances by key, within a budget of memory; safe for several threads."""

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable

import numpy as np
from numpy.typing import NDArray

from processing.synthetic.stamping import FloatImage

_STEPS = np.float32(2**16 - 1)


class ShadowCache:
    """Least recently used transmittances, kept in steps of 1 / 65535.

    A transmittance is the same, rounded, whether it was kept or made anew. Two threads that miss the same key
    both make it.

    Parameters
    ----------
    budget_bytes : int
        The oldest entries go when more than this is kept.
    """

    def __init__(self, budget_bytes: int) -> None:
        self._budget_bytes = budget_bytes
        self._kept: OrderedDict[Hashable, NDArray[np.uint16]] = OrderedDict()
        self._kept_bytes = 0
        self._lock = threading.Lock()

    def get(self, key: Hashable, make: Callable[[], FloatImage]) -> FloatImage:
        """The transmittance of a key; ``make`` renders it where it is not kept."""
        with self._lock:
            steps = self._kept.get(key)
            if steps is not None:
                self._kept.move_to_end(key)
        if steps is None:
            steps = np.rint(make() * _STEPS).astype(np.uint16)
            self._keep(key, steps)
        return np.divide(steps, _STEPS, dtype=np.float32)

    def _keep(self, key: Hashable, steps: NDArray[np.uint16]) -> None:
        with self._lock:
            if key not in self._kept:
                self._kept_bytes += steps.nbytes
            self._kept[key] = steps
            while self._kept_bytes > self._budget_bytes:
                _, oldest = self._kept.popitem(last=False)
                self._kept_bytes -= oldest.nbytes
