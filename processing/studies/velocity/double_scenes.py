"""Double exposures of droplets that fly, bright or as shadows, with their truth."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from processing.geometry import FloatArray, PinholeCamera
from processing.studies.droplets import AMPLITUDE_SPREAD, DropletCase, bright_images
from processing.studies.shadows.sizes import BESIDE_MM, SizeCase, shadow_images
from processing.studies.simulated_droplets import Image, study_cameras
from processing.studies.velocity.measured_case import AnyCase
from processing.synthetic.liquid.droplet_clouds import Box, Flow, LogNormal, droplet_cloud
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


def double_scene(
    case: AnyCase,
    grid: VoxelGrid,
    image_size_px: tuple[int, int],
    rng: np.random.Generator,
    flow: Flow = FLOW,
) -> DoubleScene:
    """Droplets all over a grid in A, of opaque ones some beyond, and where they have flown in B."""
    cameras = study_cameras(image_size_px)
    if isinstance(case, SizeCase):
        before = droplet_cloud(Box.around(grid, BESIDE_MM), case.density_per_mm3, case.sizes, rng, flow)
        heights = np.ones(len(before))
    else:
        before = droplet_cloud(Box.around(grid), case.density_per_mm3, LogNormal(), rng, flow)
        heights = rng.lognormal(0, AMPLITUDE_SPREAD, len(before))
    after = before.advanced(1e-9 * SEPARATION_NS)
    first, second = (case_images(case, cameras, spray, heights, rng) for spray in (before, after))
    return DoubleScene(before, after, (first, second), cameras)


def case_images(
    case: AnyCase, cameras: Sequence[PinholeCamera], spray: Spray, heights: FloatArray, rng: np.random.Generator
) -> list[Image]:
    """What cameras see of droplets of a case; bright ones are of such heights (N,)."""
    if isinstance(case, DropletCase):
        return bright_images(case, cameras, spray.positions_mm, heights, rng)
    return shadow_images(case, cameras, spray, rng)
