"""What pairing asks of the droplets of an exposure: where they are, how sure that is, and how large or bright."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.droplet_table import DropletRows, Droplets, SizedDroplets, sizes_of
from processing.geometry import FloatArray
from processing.volume import VoxelGrid

LEAST_SIZE = 1e-12
"""Nothing is smaller or fainter: logarithms stay finite."""


@dataclass(frozen=True, eq=False)
class MovingDroplets:
    """Droplets of one exposure.

    Parameters
    ----------
    places : (N, 3) array
        Centres (x, y, z) in voxels.
    covariance : (N, 3, 3) array
        Of the centres, in square voxels.
    log_sizes : (N,) array
        Natural logarithm of the diameter, or of the amplitude: how alike two droplets look.
    """

    places: FloatArray
    covariance: FloatArray
    log_sizes: FloatArray

    def __len__(self) -> int:
        return len(self.places)

    def where(self, chosen: NDArray[np.intp]) -> "MovingDroplets":
        """The chosen ones, by index."""
        return MovingDroplets(self.places[chosen], self.covariance[chosen], self.log_sizes[chosen])

    @classmethod
    def of(cls, droplets: DropletRows, grid: VoxelGrid) -> "MovingDroplets":
        """In voxels of a grid, from the middle of its first voxel."""
        if not isinstance(droplets, Droplets | SizedDroplets):
            raise TypeError(f"droplets of a kind that has no place in space: {type(droplets).__name__}")
        places: FloatArray = grid.to_index(droplets.points_mm)[:, ::-1]
        sizes = np.maximum(sizes_of(droplets.columns()), LEAST_SIZE)
        return cls(places, droplets.covariance_mm2 / grid.pitch_mm**2, np.log(sizes))
