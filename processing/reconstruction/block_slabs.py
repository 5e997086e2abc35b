"""The blocks of SMART as slabs of a volume, in any type of voxels."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from processing.reconstruction.kernels import _native
from processing.reconstruction.plan import DEFAULT_THREADS
from processing.reconstruction.slab_volume import SlabVolume, slabs_of
from processing.reconstruction.voxel_type import VoxelType


def slabs_of_blocks(
    blocks: _native.Blocks, voxels: VoxelType, out: NDArray[Any], threads: int = DEFAULT_THREADS
) -> SlabVolume:
    """Slabs of a volume that is stored as blocks; the scale of the blocks changes where voxels are bytes.

    Parameters
    ----------
    blocks : Blocks
        The volume.
    voxels : VoxelType
        Of the slabs; 255 is the brightest voxel where they are bytes.
    out : (z, y, x) float32 or float16 array
        Memory that the slabs are part of; float16 where voxels are bytes.
    threads : int
        The result does not depend on it.
    """
    blocks.write(out, threads)
    if voxels is not VoxelType.UINT8:
        return SlabVolume(slabs_of(out), voxels, voxels.unit)
    # halves that are not negative are in the order of their bits, which numpy compares faster
    brightest = float(out.view(np.int16).max().view(np.float16)) or 1.0
    counts = out.reshape(-1)[: (out.size + 1) // 2].view(np.uint8)[: out.size].reshape(out.shape)
    blocks.scale(1 / brightest)
    blocks.write(counts, threads)
    return SlabVolume(slabs_of(counts), voxels, brightest * voxels.unit)
