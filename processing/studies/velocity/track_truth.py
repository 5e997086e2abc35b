"""How true tracks are, where it is known which droplet is which."""

from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Labels = NDArray[np.intp]
"""Of the droplets of a shot; -1: a ghost, or on no track."""
LEAST_TIMES = 3
"""Droplets that are seen less often are on no track."""


def whole_and_right(ids: Sequence[Labels], labels: Sequence[Labels]) -> tuple[float, float]:
    """Share of the true droplets seen often enough that are one track, and share of the links that are right.

    Parameters
    ----------
    ids, labels : sequence of (N,) int arrays
        For every shot the tracks of its droplets, and which true droplets they are.
    """
    of_label, of_track = _grouped(labels, ids), _grouped(ids, labels)
    whole = [set(chain) == {chain[0]} != {-1} for chain in of_label.values() if len(chain) >= LEAST_TIMES]
    links = [one == other >= 0 for chain in of_track.values() for one, other in pairwise(chain)]
    return float(np.mean(whole)) if whole else 0.0, float(np.mean(links)) if links else 0.0


def _grouped(keys: Iterable[Labels], values: Iterable[Labels]) -> dict[int, list[int]]:
    """Values by key, shot after shot."""
    groups: dict[int, list[int]] = {}
    for of_keys, of_values in zip(keys, values, strict=True):
        for key, value in zip(of_keys.tolist(), of_values.tolist(), strict=True):
            if key >= 0:
                groups.setdefault(key, []).append(value)
    return groups
