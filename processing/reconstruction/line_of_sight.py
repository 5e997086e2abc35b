"""Line-of-sight reconstruction: each voxel combines what the views see where it is projected to."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from processing.kernels import DEFAULT_THREADS, _native
from processing.reconstruction.choices import ReconstructionMethod, VoxelType
from processing.reconstruction.planning.fixed_point import FixedPoint
from processing.reconstruction.planning.plan import Plan
from processing.reconstruction.slab_volume import SLAB_ROWS, SlabVolume, slabs_in
from processing.reconstruction.volume_part import Part
from processing.volume import VoxelGrid

FAR = 16.0
"""From 1: the eighth power of what is dimmer or brighter leaves float32, and so do voxels below a hundredth of it."""


def line_of_sight(
    plan: Plan,
    images: Sequence[NDArray[np.float32]],
    method: ReconstructionMethod = ReconstructionMethod.MLOS,
    out: NDArray[Any] | None = None,
    *,
    resampled: Sequence[NDArray[np.int16]] | None = None,
    threads: int = DEFAULT_THREADS,
) -> NDArray[Any]:
    """Reconstruct a volume from one image per view.

    Parameters
    ----------
    plan : Plan
        Geometry of views and grid.
    images : sequence of (rows, columns) float32 arrays
        Inverted shadow intensities from 0 to 1; 0 outside of the images. Samples are exact to 1e-4 of the
        brightest pixel.
    method : ReconstructionMethod
        GAVLOS, MINLOS or MLOS: geometric average, minimum or product of the bilinear samples.
    out : (z, y, x) float32, float16 or uint8 array, optional
        Receives the volume; 255 is 1 where it is of bytes.
        A reused volume is much faster than a new one: fresh memory costs more than the method.
    resampled : sequence of int16 arrays, optional
        As ``Plan.resample`` takes them; memory that is used again is faster.
    threads : int
        The result does not depend on it.

    Returns
    -------
    (z, y, x) array
        ``out``, or a new float32 volume.

    Raises
    ------
    ValueError
        Images or ``out`` do not fit the plan, ``out`` has no room for their intensities, a pixel is negative, infinite
        or not a number, or the method is an iterative one.
    """
    check_method(method)
    volume = np.empty(plan.grid.shape, dtype=np.float32) if out is None else out
    check_volume(volume, plan, (np.float32, np.float16, np.uint8))
    seen = plan.resample(images, threads, resampled)
    check_brightness(seen, method, volume.dtype)
    unit = _unit_of_products(seen, method, volume.dtype)
    _native.line_of_sight(plan.bind(_in_unit(seen, method, unit)), method, volume, threads)
    if unit != 1:
        volume *= volume.dtype.type(unit)
    return volume


def slabs_of_sight(
    plan: Plan,
    images: Sequence[NDArray[np.float32]],
    method: ReconstructionMethod = ReconstructionMethod.MLOS,
    *,
    out: NDArray[Any] | None = None,
    resampled: Sequence[NDArray[np.int16]] | None = None,
    threads: int = DEFAULT_THREADS,
) -> Iterator[tuple[int, NDArray[Any]]]:
    """Reconstruct a volume slab by slab, for all that needs no more at once. The images are read before the first.

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
    check_method(method)
    nz, ny, nx = plan.grid.shape
    memory = np.empty((nz, min(SLAB_ROWS, ny), nx), np.float16) if out is None else out
    rows = memory.shape[1]
    if rows < 1 or memory.shape != (nz, rows, nx):
        raise ValueError(f"slabs of shape {memory.shape}, they need ({nz}, one or more, {nx})")
    seen = plan.resample(images, threads, resampled)
    check_brightness(seen, method, memory.dtype)
    return _slabs_seen(plan.bind(seen), method, memory, Part.all_of(plan.grid), plan.grid, threads)


def volume_of_sight(
    plan: Plan,
    images: Sequence[NDArray[np.float32]],
    method: ReconstructionMethod,
    out: NDArray[Any],
    *,
    resampled: Sequence[NDArray[np.int16]] | None = None,
    threads: int = DEFAULT_THREADS,
) -> tuple[SlabVolume, float]:
    """The same slabs in a unit in which float16 has room for them, however dim or bright the images are.

    Parameters
    ----------
    plan, images, method, resampled, threads
        As ``slabs_of_sight`` takes them.
    out : (nz, rows, nx) float32 or float16 array
        Receives one slab after the other.

    Returns
    -------
    SlabVolume
        Its unit is 1 for float32, else a power of two, which leaves the bits of a voxel as they are.
    float
        No voxel of the slabs is brighter; above 0.
    """
    return volume_seen(plan, plan.resample(images, threads, resampled), method, out, threads=threads)


def volume_seen(
    plan: Plan,
    seen: Sequence[FixedPoint],
    method: ReconstructionMethod,
    out: NDArray[Any],
    blocks: Part | None = None,
    *,
    threads: int = DEFAULT_THREADS,
) -> tuple[SlabVolume, float]:
    """The same slabs, or a part of them, of images that are resampled already.

    Parameters
    ----------
    plan, method, out, threads
        As ``volume_of_sight`` takes them.
    seen : sequence of FixedPoint
        The images of all views, as ``Plan.resample`` returns them; they stay as they are.
    blocks : Part, optional
        Whole blocks, see ``Part.in_blocks``; by default all.
    """
    check_method(method)
    blocks = blocks or Part.all_of(plan.grid)
    brightest = _brightest_voxel(seen, method) or 1.0
    voxels = VoxelType(out.dtype.name)
    unit = 1.0 if voxels is VoxelType.FLOAT32 else 2.0 ** math.ceil(math.log2(brightest))
    views = plan.between(blocks.z).bind(_in_unit(seen, method, unit))
    slabs = _slabs_seen(views, method, out, blocks, plan.grid, threads)
    return SlabVolume(slabs, voxels, unit), brightest / unit


def _unit_of_products(images: Sequence[FixedPoint], method: ReconstructionMethod, dtype: np.dtype[Any]) -> float:
    """A power of two near the brightest voxel of GAVLOS if that is far from 1: products of many views have no room."""
    most = _brightest_voxel(images, method)
    if method is not ReconstructionMethod.GAVLOS or dtype == np.uint8 or not most or 1 / FAR < most < FAR:
        return 1.0
    return float(2.0 ** math.ceil(math.log2(most)))


def _in_unit(images: Sequence[FixedPoint], method: ReconstructionMethod, unit: float) -> list[FixedPoint]:
    """Images whose voxels are those of the given ones over the unit; powers of two are exact."""
    first, *others = images
    if method is not ReconstructionMethod.MLOS:
        return [replace(image, unit=image.unit / unit) for image in images]
    return [replace(first, unit=first.unit / unit), *others]


def _slabs_seen(
    views: Sequence[_native.View],
    method: ReconstructionMethod,
    memory: NDArray[Any],
    blocks: Part,
    grid: VoxelGrid,
    threads: int,
) -> Iterator[tuple[int, NDArray[Any]]]:
    _, ny, nx = grid.shape
    for first_row, slab in slabs_in(memory, blocks.y):
        _native.line_of_sight(views, method, slab, threads, first_row, ny, blocks.x.start, nx)
        yield first_row, slab


def check_method(method: ReconstructionMethod) -> None:
    """Raise ValueError for an iterative method."""
    if method not in _native.METHODS:
        raise ValueError(f"{method.value} is not a line-of-sight method: {list(_native.METHODS)}")


def check_brightness(images: Sequence[FixedPoint], method: ReconstructionMethod, dtype: np.dtype[Any]) -> None:
    """Raise ValueError where a voxel could be brighter than its type has room for."""
    most = _brightest_voxel(images, method)
    room = 1.0 if dtype == np.uint8 else float(np.finfo(dtype).max)
    if most > room * (1 + 1e-6):
        raise ValueError(f"voxels of {dtype} hold intensities up to {room:.3g}, these may reach {most:.3g}")


def _brightest_voxel(images: Sequence[FixedPoint], method: ReconstructionMethod) -> float:
    """Largest intensity that a voxel could have: where the brightest pixels of all views meet."""
    brightest = [image.brightest for image in images]
    product = float(np.prod(brightest, dtype=np.float64))
    most: float = {
        ReconstructionMethod.GAVLOS: product ** (1 / len(images)),
        ReconstructionMethod.MINLOS: min(brightest),
        ReconstructionMethod.MLOS: product,
    }[method]
    return most


def check_volume(volume: NDArray[Any], plan: Plan, dtypes: tuple[type, ...]) -> None:
    """Raise ValueError unless a volume has the shape of the plan, one of the types, and contiguous memory."""
    if volume.shape != plan.grid.shape:
        raise ValueError(f"volume has shape {volume.shape}, the plan {plan.grid.shape}")
    if volume.dtype not in [np.dtype(dtype) for dtype in dtypes] or not volume.flags.c_contiguous:
        names = " or ".join(np.dtype(dtype).name for dtype in dtypes)
        raise ValueError(f"volume must be contiguous {names}, not {volume.dtype} with strides {volume.strides}")
