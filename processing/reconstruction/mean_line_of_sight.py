"""The mean volume of many exposures, without a volume for each of them."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain
from typing import Self

import numpy as np
from numpy.typing import NDArray

from processing.kernels import DEFAULT_THREADS, _native
from processing.preprocessing import Intensity
from processing.reconstruction.choices import ReconstructionMethod, VoxelType
from processing.reconstruction.line_of_sight import check_brightness, check_method, check_volume
from processing.reconstruction.planning.fixed_point import FixedPoint
from processing.reconstruction.planning.plan import Plan
from processing.reconstruction.slab_volume import SLAB_ROWS, Slabs, SlabVolume, slabs_in, slabs_of
from processing.reconstruction.volume_part import Part

BATCH_BYTES, BATCH_EXPOSURES = 1 << 30, 128
"""Most of resampled images in memory at the same time; the volume is read and written once for each batch."""

_TOO_FEW = "a mean needs one exposure or more"

Exposure = Sequence[NDArray[np.float32]]
Batch = list[list[FixedPoint]]


@dataclass(frozen=True, eq=False)
class MeanVolume:
    """A mean that need not be in memory as a whole.

    Parameters
    ----------
    slabs : callable
        Makes its slabs, float32, as often as it is called; a slab is in the memory of the one before.
    part : callable
        Makes a part of it, (nz, ny, nx) float32.
    """

    slabs: Callable[[], Slabs]
    part: Callable[[Part], Intensity]

    @classmethod
    def of(cls, volume: Intensity) -> Self:
        """One that is in memory, (nz, ny, nx)."""
        return cls(partial(slabs_of, volume), partial(_part_of, volume))


def _part_of(volume: Intensity, part: Part) -> Intensity:
    return part.of(volume)


def mean_line_of_sight(
    plan: Plan,
    exposures: Iterable[Exposure],
    method: ReconstructionMethod = ReconstructionMethod.MLOS,
    out: NDArray[np.float32] | None = None,
    *,
    threads: int = DEFAULT_THREADS,
) -> NDArray[np.float32]:
    """Mean of the volumes that ``line_of_sight`` makes of single exposures.

    Parameters
    ----------
    plan : Plan
        Geometry of views and grid.
    exposures : iterable
        One image per view each, as ``line_of_sight`` takes them; may be read from disk as they are asked for.
    method : ReconstructionMethod
        GAVLOS, MINLOS or MLOS.
    out : (z, y, x) float32 array, optional
        Receives the mean.
    threads : int
        The result does not depend on it.

    Raises
    ------
    ValueError
        There is no exposure, images or ``out`` do not fit the plan, or the method is an iterative one.
    """
    check_method(method)
    mean = np.empty(plan.grid.shape, np.float32) if out is None else out
    check_volume(mean, plan, (np.float32,))
    return _mean(plan, mean, _batches(plan, iter(exposures), method, _memory(plan), threads), method, threads)


def mean_volume(
    plan: Plan, exposures: Iterable[Exposure], method: ReconstructionMethod, *, threads: int = DEFAULT_THREADS
) -> MeanVolume:
    """The same mean, made slab by slab, or a part of it, when somebody calls for that.

    Where the exposures do not fit into one batch, the whole mean is made now; else it never is in memory.

    Parameters
    ----------
    plan, exposures, method, threads
        As ``mean_line_of_sight`` takes them.

    Raises
    ------
    ValueError
        As ``mean_line_of_sight`` does.
    """
    check_method(method)
    coming, memory = iter(exposures), _memory(plan)
    first = next(_batches(plan, coming, method, memory, threads), None)
    if first is None:
        raise ValueError(_TOO_FEW)
    beyond = next(coming, None)
    if beyond is None:
        whole = Part.all_of(plan.grid)
        return MeanVolume(
            partial(_slabs, plan, first, method, whole, threads), partial(_part, plan, first, method, threads)
        )
    others = _batches(plan, chain([beyond], coming), method, memory, threads)
    return MeanVolume.of(_mean(plan, np.empty(plan.grid.shape, np.float32), chain([first], others), method, threads))


def _slabs(plan: Plan, batch: Batch, method: ReconstructionMethod, blocks: Part, threads: int) -> Slabs:
    _, ny, nx = plan.grid.shape
    views, memory = (
        _bound(plan.between(blocks.z), batch),
        np.empty((len(blocks.z), min(SLAB_ROWS, len(blocks.y)), len(blocks.x)), np.float32),
    )
    for first_row, slab in slabs_in(memory, blocks.y):
        _native.sum_of_sight(views, method, slab, threads, first_row, ny, blocks.x.start, nx, mean=True)
        yield first_row, slab


def _part(plan: Plan, batch: Batch, method: ReconstructionMethod, threads: int, part: Part) -> Intensity:
    blocks = part.in_blocks(plan.grid)
    slabs = _slabs(plan, batch, method, blocks, threads)
    return part.taken_from(SlabVolume(slabs, VoxelType.FLOAT32, 1.0), blocks)


def _bound(plan: Plan, batch: Batch) -> list[list[_native.View]]:
    return [plan.bind(seen) for seen in batch]


def _memory(plan: Plan) -> list[list[NDArray[np.int16]]]:
    """For the images of a batch; it is occupied as they come."""
    fitting = max(1, min(BATCH_EXPOSURES, BATCH_BYTES // plan.resampled_bytes))
    return [list(plan.empty_images()) for _ in range(fitting)]


def _batches(
    plan: Plan,
    coming: Iterator[Exposure],
    method: ReconstructionMethod,
    memory: Sequence[Sequence[NDArray[np.int16]]],
    threads: int,
) -> Iterator[Batch]:
    """Exposures by as many as there is memory for; those of one batch are gone when the next one is asked for."""

    def resampled(images: Exposure, own: Sequence[NDArray[np.int16]]) -> list[FixedPoint]:
        seen = plan.resample(images, threads, own)
        check_brightness(seen, method, np.dtype(np.float32))
        return seen

    # in this order: where the memory ends, no exposure is taken
    while batch := [resampled(one, own) for own, one in zip(memory, coming, strict=False)]:
        yield batch


def _mean(
    plan: Plan, mean: NDArray[np.float32], batches: Iterable[Batch], method: ReconstructionMethod, threads: int
) -> NDArray[np.float32]:
    mean.fill(0)
    count = 0
    for batch in batches:
        _native.sum_of_sight(_bound(plan, batch), method, mean, threads)
        count += len(batch)
    if not count:
        raise ValueError(_TOO_FEW)
    mean /= np.float32(count)
    return mean
