"""Droplets in even rows, as of a jet that is made to break up: one spacing farther on they look the same.

So nothing tells whether they fly by a spacing more or less from one exposure to the next.
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.lingering_droplets import ALIKE, seen_in_a
from processing.geometry import FloatArray

FEWEST, MOST = 8, 60
"""Droplets of a shot that are asked: those in the middle. Of fewer nothing is said."""
RADIUS = 0.15
"""Of the median distance to the nearest droplet, within which two ways are one and the same."""
LEAST_SHARE = 0.5
"""Of the droplets, from which one and the same way leads to another one as large; chance leads a tenth."""
MOST_SHOTS = 5


def row_spacing_mm(shots: Sequence[StoredDroplets]) -> float | None:
    """Distance in mm by which droplets of exposure A stand apart in even rows; None where most do not."""
    asked = [shot for shot in shots if np.count_nonzero(shot.columns["frame"] == "a") >= FEWEST]
    spacings_mm = [_spacing_mm(*_in_the_middle(*seen_in_a(shot))) for shot in asked[:MOST_SHOTS]]
    known = [one for one in spacings_mm if one is not None]
    return float(np.median(known)) if 2 * len(known) > len(spacings_mm) else None


def _in_the_middle(places_mm: FloatArray, log_sizes: FloatArray) -> tuple[FloatArray, FloatArray]:
    middle = np.argsort(np.linalg.norm(places_mm - np.median(places_mm, axis=0), axis=1), kind="stable")[:MOST]
    return places_mm[middle], log_sizes[middle]


def _spacing_mm(places_mm: FloatArray, log_sizes: FloatArray) -> float | None:
    """Length of the commonest way from droplets to others as large; None where few go it."""
    nearest_mm = np.asarray(KDTree(places_mm).query(places_mm, k=[2])[0])
    alike = np.abs(log_sizes[:, None] - log_sizes) < ALIKE
    own, other = np.nonzero(alike & ~np.eye(len(places_mm), dtype=bool))
    ways_mm = places_mm[other] - places_mm[own]
    if not len(ways_mm):
        return None
    radius_mm = RADIUS * float(np.median(nearest_mm))
    counts = np.asarray(KDTree(ways_mm).query_ball_point(ways_mm, radius_mm, return_length=True))
    commonest = int(np.argmax(counts))
    return float(np.linalg.norm(ways_mm[commonest])) if counts[commonest] >= LEAST_SHARE * len(places_mm) else None
