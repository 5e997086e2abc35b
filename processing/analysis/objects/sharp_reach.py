"""How far liquid hangs together with the nozzle, by finer voxels and images without their blur.

Both are needed: in voxels of 1.5 px and blurred images, bodies that are 1 to 3 px apart look like one. Only the box of
what may hang together is asked: what does so in blurred images, by the lowest threshold.
"""

from collections.abc import Sequence

import numpy as np

from processing.analysis.objects.break_up import Nozzle, Reach, at_nozzle, reach_of
from processing.analysis.objects.dark_voxels import DarkVoxels
from processing.analysis.objects.hull import hull_of, known
from processing.analysis.objects.sharp_images import sharpened
from processing.geometry import ViewMapping
from processing.kernels import DEFAULT_THREADS
from processing.preprocessing import Intensity
from processing.reconstruction.planning.plan import plan_reconstruction
from processing.volume import VoxelGrid

PITCH_PX = 1.25
"""Width of a voxel, over that of a pixel: of one, simulated shots are told no better, at twice the cost."""
MARGIN_VOXELS = 4
"""Around what may hang together."""


def sharp_reach(
    darkness: Sequence[Intensity],
    trust: Sequence[Intensity] | None,
    mappings: Sequence[ViewMapping],
    voxels: DarkVoxels,
    nozzle: Nozzle,
    *,
    pixel_mm: float,
    threads: int = DEFAULT_THREADS,
) -> Reach:
    """How far liquid of one exposure hangs together with a nozzle.

    Parameters
    ----------
    darkness : sequence of (rows, columns) float32 arrays
        Share of the light that is missing; all of it where nothing is known.
    trust : sequence of (rows, columns) float32 arrays, optional
        0 where nothing is known.
    mappings : sequence of ViewMapping
        Of the views.
    voxels : DarkVoxels
        What all views see dark, in voxels that may be wider.
    nozzle : Nozzle
        Where the liquid comes from.
    pixel_mm : float
        Width of a pixel.
    threads : int
        The result does not depend on it.

    Raises
    ------
    ValueError
        Too many voxels are dark.
    """
    body = at_nozzle(voxels, nozzle)
    if not len(body):
        return reach_of(voxels, nozzle)
    sharp = [sharpened(dark, None if trust is None else trust[view]) for view, dark in enumerate(darkness)]
    hull = hull_of(sharp, plan_reconstruction(mappings, box_around(body, PITCH_PX * pixel_mm)), threads)
    return reach_of(known(hull, trust, mappings), nozzle)


def box_around(body: DarkVoxels, pitch_mm: float) -> VoxelGrid:
    """A finer grid around a body, within the grid of that."""
    indices = body.indices
    low = np.maximum(indices.min(axis=0) - MARGIN_VOXELS, 0)
    high = np.minimum(indices.max(axis=0) + MARGIN_VOXELS + 1, body.grid.shape)
    nz, ny, nx = (int(n) for n in np.ceil((high - low) * body.grid.pitch_mm / pitch_mm - 1e-6))
    x_mm, y_mm, z_mm = (body.grid.to_mm(low - 0.5) + pitch_mm / 2).tolist()
    return VoxelGrid((nz, ny, nx), (x_mm, y_mm, z_mm), pitch_mm)
