"""Whether droplets are there twice: two flashes in one exposure, or a reflection in a window."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.analysis.common_way import LEAST, common_way, ways_between
from processing.analysis.droplets.droplet_table import DropletRows, sizes_of
from processing.analysis.droplets.measured_exposure import MeasuredExposure, Rows, Seen
from processing.geometry import FloatArray
from processing.volume import VoxelGrid

MOST_DROPLETS = 250
"""That are asked, those nearest to the middle: they are enough to tell."""


@dataclass(frozen=True)
class Look:
    """How copies are looked for.

    Parameters
    ----------
    spread_voxel : float
        So much ways of droplets that fly together differ.
    shortest_voxel : float
        So long such ways are at least.
    least : int
        So many must agree.
    share : float
        Of the droplets, that must have a copy; where all are there twice it is a half, less those that leave the box.
    fainter : bool
        Ways lead from droplets to fainter or smaller ones alone, by about as many times.
    """

    spread_voxel: float
    shortest_voxel: float
    least: int
    share: float
    fainter: bool = False


LOOKS = (
    Look(4.0, 0.0, LEAST, 0.25),
    Look(8.0, 12.0, 2 * LEAST, 0.25),
    Look(4.0, 0.0, LEAST - 1, 0.08, fainter=True),
)
"""In a cone, or a spray that scatters, ways differ by more than 4 voxels, and so do those of rows and clusters, which
are short, or few. A weak flash shows copies of large droplets alone: so few are enough, as other ways that lead to what
is smaller by as much hardly agree."""
FAINTER, RATIO_SPREAD = 1.3, 0.4
"""Copies of a weak flash are smaller or fainter by so many times; and how much logarithms of that differ."""
NEARBY, CHANCES = 2, 2
"""So many spreads around a way others tell what it has by chance; so many times that does not count: clusters have more
in their middle."""
ONWARDS = np.array([0.6, 0.8, 0.3])
"""Ways are counted in this direction: no axis is across it."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """Ways between droplets.

    Parameters
    ----------
    droplets : int
        That were asked.
    ways_voxel : (N, 3) array
        From each to each other one, onwards.
    shrinks : (N,) array
        Logarithm of the size where a way begins over that where it ends.
    """

    droplets: int
    ways_voxel: FloatArray
    shrinks: FloatArray

    @classmethod
    def of(cls, droplets: DropletRows, pitch_mm: float) -> "Pairs":
        """Of those nearest to the middle."""
        asked = _asked(droplets.points_mm)
        places, logs = droplets.points_mm[asked] / pitch_mm, np.log(sizes_of(droplets.columns())[asked])
        ways = ways_between(np.column_stack([places, -logs]), np.append(ONWARDS, 0.0))
        return cls(len(asked), ways[:, :3], ways[:, 3])

    def seen_by(self, look: Look) -> FloatArray:
        """Ways over their spread (N, 3), or with logarithms of ratios (N, 4), such as a look is for."""
        if not look.fainter:
            long = np.linalg.norm(self.ways_voxel, axis=1) >= look.shortest_voxel
            return np.asarray(self.ways_voxel[long] / look.spread_voxel)
        smaller = np.abs(self.shrinks) > np.log(FAINTER)
        ways, shrinks = self.ways_voxel[smaller], self.shrinks[smaller]
        return np.column_stack([ways * np.sign(shrinks)[:, None] / look.spread_voxel, np.abs(shrinks) / RATIO_SPREAD])


def judged_by_copies(shot: MeasuredExposure[Rows, Seen], grid: VoxelGrid) -> MeasuredExposure[Rows, Seen]:
    """A shot, doubtful where droplets are there again, all of them as far away."""
    pairs = Pairs.of(shot.droplets, grid.pitch_mm)
    reason = next(filter(None, (_copies(pairs, look, grid.pitch_mm) for look in LOOKS)), "")
    return shot.doubted((reason,)) if reason else shot


def _copies(pairs: Pairs, look: Look, pitch_mm: float) -> str:
    """What is wrong where so many have a copy, as far away but for a spread; empty where they have none.

    Between two clusters there are more such ways than droplets: these are no copies.
    """
    ways = pairs.seen_by(look)
    common, count = common_way(ways, 1.0)
    if count > pairs.droplets:
        return ""
    if count - CHANCES * _by_chance(ways - common) < max(look.least, look.share * pairs.droplets):
        return ""
    way = ", ".join(f"{along_mm:.2f}" for along_mm in common[:3] * look.spread_voxel * pitch_mm)
    return (
        f"{count} of {pairs.droplets} droplets are there again {way} mm away (x, y, z): is the light on twice within "
        "an exposure, are A and B in one image, or do they reflect in a window? They count twice then"
    )


def _asked(points_mm: FloatArray) -> NDArray[np.intp]:
    """The droplets nearest to the middle."""
    if not len(points_mm):
        return np.empty(0, np.intp)
    return np.argsort(np.linalg.norm(points_mm - np.median(points_mm, axis=0), axis=1))[:MOST_DROPLETS]


def _by_chance(beside: FloatArray) -> float:
    """How many ways (N, D) are one as ways nearby are: droplets that lie in clusters have many, and no copies."""
    spreads = np.linalg.norm(beside, axis=1)
    return float(np.count_nonzero((spreads > 1) & (spreads <= NEARBY)) / (NEARBY ** beside.shape[1] - 1))
