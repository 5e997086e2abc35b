"""Line of sight without the whole volume: as bricks, or slab by slab along y."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from processing.reconstruction.kernels import _native
from processing.reconstruction.line_of_sight import DEFAULT_THREADS, kernel_method
from processing.reconstruction.method import ReconstructionMethod
from processing.reconstruction.plan import Plan
from processing.reconstruction.sparse_volume import SparseVolume

SLAB_ROWS = 64
"""A slab of the paper's volume has 75 MB in float16."""


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
    rows: int = SLAB_ROWS,
    dtype: DTypeLike = np.float16,
    threads: int = DEFAULT_THREADS,
) -> Iterator[tuple[int, NDArray[Any]]]:
    """Reconstruct a volume slab by slab, for statistics that need no more.

    Parameters
    ----------
    plan, images, method, threads
        As ``line_of_sight`` takes them.
    rows : int
        Rows y of a slab; the last one has what is left.
    dtype : data type
        float32, float16 or uint8.

    Yields
    ------
    int
        The slab's first row y in the volume.
    (nz, rows, nx) array
        The slab; its memory is used again for the next one.

    Raises
    ------
    ValueError
        ``rows`` is not positive, images do not fit the plan, or the method is an iterative one.
    """
    number = kernel_method(method)
    if rows < 1:
        raise ValueError(f"slabs of {rows} rows, they need one or more")
    views = plan.bind(plan.resample(images, threads))
    nz, ny, nx = plan.grid.shape
    memory = np.empty(nz * min(rows, ny) * nx, dtype)
    for first_row in range(0, ny, rows):
        here = min(rows, ny - first_row)
        slab = memory[: nz * here * nx].reshape(nz, here, nx)
        _native.line_of_sight(views, number, slab, threads, first_row, ny)
        yield first_row, slab
