"""Line of sight without the whole volume: as bricks, or slab by slab along y."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from processing.kernels import DEFAULT_THREADS, _native
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.line_of_sight import kernel_method
from processing.reconstruction.planning.plan import Plan
from processing.reconstruction.slab_volume import SLAB_ROWS, slabs_in
from processing.reconstruction.sparse_volume import SparseVolume


def sparse_line_of_sight(
    plan: Plan,
    images: Sequence[NDArray[np.float32]],
    method: ReconstructionMethod = ReconstructionMethod.MLOS,
    *,
    floor: float = 0.0,
    threads: int = DEFAULT_THREADS,
) -> SparseVolume:
    """Reconstruct a volume where it is not empty; the same values as ``line_of_sight``, in float16.

    Parameters
    ----------
    plan, images, method, threads
        As ``line_of_sight`` takes them.
    floor : float
        Bricks without any voxel above it are left out.

    Raises
    ------
    ValueError
        Images do not fit the plan, or the method is an iterative one.
    """
    number = kernel_method(method)
    views = plan.bind(plan.resample(images, threads))
    positions, halves = _native.sparse_sight(views, number, plan.grid.shape, floor, threads)
    return SparseVolume(plan.grid.shape, positions, halves.view(np.float16))


def slabs_of_sight(
    plan: Plan,
    images: Sequence[NDArray[np.float32]],
    method: ReconstructionMethod = ReconstructionMethod.MLOS,
    *,
    out: NDArray[Any] | None = None,
    resampled: Sequence[NDArray[np.int16]] | None = None,
    threads: int = DEFAULT_THREADS,
) -> Iterator[tuple[int, NDArray[Any]]]:
    """Reconstruct a volume slab by slab, for all that needs no more at once.

    Parameters
    ----------
    plan, images, method, threads
        As ``line_of_sight`` takes them.
    out : (nz, rows, nx) float32, float16 or uint8 array, optional
        Receives one slab after the other, of so many rows y; the last one has what is left. By default new memory
        of ``SLAB_ROWS`` rows of float16.
    resampled : sequence of int16 arrays, optional
        As ``Plan.resample`` takes them; memory that is used again is faster.

    Yields
    ------
    int
        The slab's first row y in the volume.
    (nz, rows, nx) array
        The slab, in ``out``; its memory is used again for the next one.

    Raises
    ------
    ValueError
        ``out`` has no rows or other planes and columns than the grid, images do not fit the plan, or the method is
        an iterative one.
    """
    number = kernel_method(method)
    nz, ny, nx = plan.grid.shape
    memory = np.empty((nz, min(SLAB_ROWS, ny), nx), np.float16) if out is None else out
    rows = memory.shape[1]
    if rows < 1 or memory.shape != (nz, rows, nx):
        raise ValueError(f"slabs of shape {memory.shape}, they need ({nz}, one or more, {nx})")
    views = plan.bind(plan.resample(images, threads, resampled))
    for first_row, slab in slabs_in(memory, ny):
        _native.line_of_sight(views, number, slab, threads, first_row, ny)
        yield first_row, slab
