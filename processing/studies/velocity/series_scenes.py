"""Series in time of droplets that fly and accelerate, with their truth: who is who in every shot."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.geometry import FloatArray
from processing.studies.droplets import AMPLITUDE_SPREAD
from processing.studies.shadows.sizes import BESIDE_MM, SizeCase
from processing.synthetic.liquid.droplet_clouds import Box, Flow, droplet_cloud
from processing.synthetic.spray import Spray
from processing.volume import VoxelGrid

RATE_HZ = 10_000.0
FLOW = Flow((700.0, 550.0, 280.0), ((60.0, 20.0, 50.0), (35.0, -30.0, 20.0), (15.0, -10.0, -25.0)), 50.0)
"""At 60 voxel/mm 4, 3 and 2 voxels from shot to shot in the middle, with a scatter of 0.3 voxel."""
ACCELERATION_MM_PER_S2 = 5e4
"""Standard deviation of each component from droplet to droplet: 0.03 voxel per shot squared."""
SIGMAS = 4.0
"""Hardly a droplet is faster than the mean by so many times the scatter."""


@dataclass(frozen=True, eq=False)
class FlyingDroplets:
    """Droplets of a series, numbered once for all shots.

    Parameters
    ----------
    first : Spray
        In shot 0.
    accelerations_mm_per_s2 : (N, 3) array
        Constant.
    heights : (N,) array
        Of bright particles.
    """

    first: Spray
    accelerations_mm_per_s2: FloatArray
    heights: FloatArray

    def positions_mm(self, shot: int) -> FloatArray:
        """Where they are (N, 3)."""
        time_s = shot / RATE_HZ
        return (
            self.first.positions_mm
            + time_s * self.first.velocities_mm_per_s
            + 0.5 * time_s**2 * (self.accelerations_mm_per_s2)
        )

    def velocities_mm_per_s(self, shot: int) -> FloatArray:
        """How fast they are (N, 3)."""
        return self.first.velocities_mm_per_s + shot / RATE_HZ * self.accelerations_mm_per_s2

    def shown(self, shot: int, grid: VoxelGrid) -> NDArray[np.intp]:
        """Numbers of those in a grid, and a little beyond."""
        box, positions_mm = Box.around(grid, BESIDE_MM), self.positions_mm(shot)
        return np.flatnonzero(np.all((positions_mm > box.lower_mm) & (positions_mm < box.upper_mm), axis=1))

    def spray(self, shot: int, chosen: NDArray[np.intp]) -> Spray:
        """The chosen ones as they are in a shot."""
        return Spray.of_droplets(
            self.positions_mm(shot)[chosen],
            self.first.diameters_mm[chosen],
            self.velocities_mm_per_s(shot)[chosen],
        )


def flying_droplets(density_per_mm3: float, grid: VoxelGrid, shots: int, rng: np.random.Generator) -> FlyingDroplets:
    """Droplets all over a grid in every shot: the first shot has those, too, that will fly into it."""
    corners_mm = np.abs(Box.around(grid, BESIDE_MM).lower_mm)
    steady = np.abs(FLOW.velocity_mm_per_s) + np.abs(FLOW.gradient_per_s) @ corners_mm
    travel_mm = float(np.max(steady + SIGMAS * FLOW.scatter_mm_per_s)) * shots / RATE_HZ
    box = Box.around(grid, BESIDE_MM + travel_mm)
    first = droplet_cloud(box, density_per_mm3, SizeCase().sizes, rng, FLOW)
    accelerations = rng.normal(0, ACCELERATION_MM_PER_S2, (len(first), 3))
    return FlyingDroplets(first, accelerations, rng.lognormal(0, AMPLITUDE_SPREAD, len(first)))
