"""The blocks of SMART as slabs of a volume, in any type of voxels."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from processing.kernels import DEFAULT_THREADS, _native
from processing.reconstruction.choices import VoxelType
from processing.reconstruction.slab_volume import SlabVolume, slabs_in

SEARCH_ROWS = 16
"""Rows in which the brightest voxel is looked for at a time."""


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
    out : (nz, rows, nx) array of that type
        Receives one slab after the other; a multiple of 8 rows y, or all.
    threads : int
        The result does not depend on it.
    """
    unit = voxels.unit
    if voxels is VoxelType.UINT8:
        brightest = _brightest(blocks, threads)
        blocks.scale(1 / brightest)
        unit *= brightest
    return SlabVolume(_written(blocks, out, threads), voxels, unit)


def _written(blocks: _native.Blocks, out: NDArray[Any], threads: int) -> Iterator[tuple[int, NDArray[Any]]]:
    for first_row, slab in slabs_in(out, blocks.shape[1]):
        blocks.write(slab, threads, first_row)
        yield first_row, slab


def _brightest(blocks: _native.Blocks, threads: int) -> float:
    """Largest voxel, or 1 where all are empty."""
    nz, _, nx = blocks.shape
    halves = np.empty((nz, SEARCH_ROWS, nx), np.float16)
    # halves that are not negative are in the order of their bits, which numpy compares faster
    bits = max(slab.view(np.int16).max() for _, slab in _written(blocks, halves, threads))
    return float(bits.view(np.float16)) or 1.0
