"""Double exposures of droplets that fly, bright or as shadows, with their truth."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.geometry import FloatArray, PinholeCamera
from processing.studies.droplets import AMPLITUDE_SPREAD
from processing.studies.simulated_droplets import study_cameras
from processing.synthetic.bright_particles import spots_image
from processing.synthetic.liquid.droplet_clouds import Box, Flow, LogNormal, droplet_cloud
from processing.synthetic.paper_rig import paper_optics
from processing.synthetic.shadow_shots import Counting, transmission_images
from processing.synthetic.spray import Spray
from processing.volume import VoxelGrid

SEPARATION_NS = 6400
"""The paper's."""
FLOW = Flow(
    (23_400.0, 18_200.0, 7_800.0),
    ((1700.0, 500.0, 1400.0), (1000.0, 900.0, 600.0), (400.0, -300.0, -700.0)),
    780.0,
)
"""In 6.4 us at 60 voxel/mm 9, 7 and 3 voxels in the middle, 7 to 17 in all, with a scatter of 0.3 voxel."""
BESIDE_MM = 0.15
"""So far around the grid there are opaque droplets, too."""
SIGMA_PX, NOISE = 1.0, 0.03
"""Of bright particles: width of their images, and noise over their median height."""
MEDIAN_MM, SPREAD, COUNTING_NOISE = 0.04, 0.4, 0.012
"""Of opaque droplets: lognormal diameters, none below 10 um; and noise of the light."""
Image = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class DoubleScene:
    """A simulated double exposure.

    Parameters
    ----------
    before, after : Spray
        The same droplets in A and in B, row by row; some lie outside of the grid.
    images : pair of lists of (rows, columns) float32 arrays
        Of A and of B, one per camera.
    cameras : list of PinholeCamera
        As they are, and as the calibration has them.
    """

    before: Spray
    after: Spray
    images: tuple[list[Image], list[Image]]
    cameras: list[PinholeCamera]

    @property
    def moved_mm(self) -> FloatArray:
        """Displacements (N, 3)."""
        return self.after.positions_mm - self.before.positions_mm


def bright_double(
    density_per_mm3: float,
    grid: VoxelGrid,
    image_size_px: tuple[int, int],
    rng: np.random.Generator,
    flow: Flow = FLOW,
) -> DoubleScene:
    """Bright particles of lognormal height all over a grid in A, and where they have flown in B."""
    cameras = study_cameras(image_size_px)
    before = droplet_cloud(Box.around(grid), density_per_mm3, LogNormal(), rng, flow)
    heights = rng.lognormal(0, AMPLITUDE_SPREAD, len(before))
    after = before.advanced(1e-9 * SEPARATION_NS)
    first, second = (bright_images(cameras, spray, heights, rng) for spray in (before, after))
    return DoubleScene(before, after, (first, second), cameras)


def bright_images(
    cameras: Sequence[PinholeCamera], spray: Spray, heights: FloatArray, rng: np.random.Generator
) -> list[Image]:
    """What cameras see of bright particles of such heights (N,), with noise."""
    drawn = [spots_image(camera, spray.positions_mm, heights, SIGMA_PX) for camera in cameras]
    return [(image + rng.normal(0, NOISE, image.shape)).astype(np.float32) for image in drawn]


def shadow_double(
    density_per_mm3: float,
    grid: VoxelGrid,
    image_size_px: tuple[int, int],
    rng: np.random.Generator,
    flow: Flow = FLOW,
) -> DoubleScene:
    """Opaque droplets all over a grid and a little beyond, and where they have flown in B."""
    cameras = study_cameras(image_size_px)
    before = droplet_cloud(Box.around(grid, BESIDE_MM), density_per_mm3, LogNormal(MEDIAN_MM, SPREAD), rng, flow)
    after = before.advanced(1e-9 * SEPARATION_NS)
    first, second = (shadow_images(cameras, spray, rng) for spray in (before, after))
    return DoubleScene(before, after, (first, second), cameras)


def shadow_images(cameras: Sequence[PinholeCamera], spray: Spray, rng: np.random.Generator) -> list[Image]:
    """What the paper's lenses show of opaque droplets, with noise."""
    counting = Counting.of_noise(COUNTING_NOISE)
    return list(transmission_images(cameras, list(paper_optics().values()), spray, counting, rng))
