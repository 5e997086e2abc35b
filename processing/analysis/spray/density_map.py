"""DensityMap: droplets per volume, column by column through the measured box: mean, and how shots scatter."""

from dataclasses import dataclass

import numpy as np

from processing.analysis.spray.spray_sample import SpraySample
from processing.geometry import FloatArray

CELLS = 24
"""Along the longest edge."""


@dataclass(frozen=True, eq=False)
class DensityMap:
    """Number density over two axes, mean along the third.

    Parameters
    ----------
    across, down : str
        Names of the axes, x, y or z.
    across_mm, down_mm : (k + 1,) arrays
        Edges of the cells.
    mean_per_mm3 : (rows, columns) array
        Over all exposures, per volume that could be measured; what is hidden is taken off everywhere alike.
    rms_per_mm3 : (rows, columns) array
        Standard deviation of shots; not a number of a single one.
    chance_per_mm3 : (rows, columns) array
        What counting alone would make of it (Poisson).
    """

    across: str
    down: str
    across_mm: FloatArray
    down_mm: FloatArray
    mean_per_mm3: FloatArray
    rms_per_mm3: FloatArray
    chance_per_mm3: FloatArray


def density_map(sample: SpraySample, across: str = "x", down: str = "y") -> DensityMap | None:
    """Number density of a sample over two axes; None where shots were measured in several boxes.

    Parameters
    ----------
    sample : SpraySample
        The droplets.
    across, down : str
        Axes of the map.
    """
    if sample.box_mm is None:
        return None
    first, second = "xyz".index(across), "xyz".index(down)
    extents_mm = np.diff(sample.box_mm, axis=0)[0]
    edges_mm = [
        np.linspace(
            sample.box_mm[0, axis],
            sample.box_mm[1, axis],
            max(round(CELLS * extents_mm[axis] / extents_mm.max()), 1) + 1,
        )
        for axis in (second, first)
    ]
    places = [np.arange(len(sample.volumes_mm3) + 1) - 0.5, *edges_mm]
    values = np.column_stack([sample.shot, sample.points_mm[:, second], sample.points_mm[:, first]])
    counts, _ = np.histogramdd(values, bins=places)
    cell_mm3 = sample.volumes_mm3 / counts[0].size
    mean = counts.sum(0) / cell_mm3.sum()
    several = len(counts) > 1
    rms = np.std(counts / cell_mm3[:, None, None], axis=0, ddof=1) if several else np.full(mean.shape, np.nan)
    per_shot = sample.exposures_per_shot  # A and B show the same droplets
    chance = np.sqrt(per_shot * mean / cell_mm3.mean())
    return DensityMap(across, down, edges_mm[1], edges_mm[0], mean, rms, chance)
