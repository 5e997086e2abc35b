"""The mean volume of many exposures, without a volume for each of them."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from processing.kernels import DEFAULT_THREADS, _native
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.line_of_sight import check_brightness, check_method, check_volume
from processing.reconstruction.planning.plan import Plan
from processing.reconstruction.slab_volume import SLAB_ROWS, Slabs, slabs_in, slabs_of

BATCH_BYTES, BATCH_EXPOSURES = 1 << 30, 128
"""Most of resampled images in memory at the same time; the volume is read and written once for each batch."""

_TOO_FEW = "a mean needs one exposure or more"

Exposure = Sequence[NDArray[np.float32]]
Batch = list[list[_native.View]]


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
    return _mean(mean, _batches(plan, iter(exposures), method, _memory(plan), threads), method, threads)


def mean_slabs(
    plan: Plan, exposures: Iterable[Exposure], method: ReconstructionMethod, *, threads: int = DEFAULT_THREADS
) -> Callable[[], Slabs]:
    """The same mean in slabs, made as often as somebody calls for them, each in the memory of the one before.

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
        return partial(_slabs, first, method, plan.grid.shape, threads)
    others = _batches(plan, chain([beyond], coming), method, memory, threads)
    return partial(slabs_of, _mean(np.empty(plan.grid.shape, np.float32), chain([first], others), method, threads))


def _slabs(batch: Batch, method: ReconstructionMethod, shape: tuple[int, int, int], threads: int) -> Slabs:
    nz, ny, nx = shape
    for first_row, slab in slabs_in(np.empty((nz, min(SLAB_ROWS, ny), nx), np.float32), range(ny)):
        slab.fill(0)
        _native.sum_of_sight(batch, method, slab, threads, first_row, ny)
        slab /= np.float32(len(batch))
        yield first_row, slab


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

    def bound(images: Exposure, own: Sequence[NDArray[np.int16]]) -> list[_native.View]:
        seen = plan.resample(images, threads, own)
        check_brightness(seen, method, np.dtype(np.float32))
        return plan.bind(seen)

    # in this order: where the memory ends, no exposure is taken
    while batch := [bound(one, own) for own, one in zip(memory, coming, strict=False)]:
        yield batch


def _mean(
    mean: NDArray[np.float32], batches: Iterable[Batch], method: ReconstructionMethod, threads: int
) -> NDArray[np.float32]:
    mean.fill(0)
    count = 0
    for batch in batches:
        _native.sum_of_sight(batch, method, mean, threads)
        count += len(batch)
    if not count:
        raise ValueError(_TOO_FEW)
    mean /= np.float32(count)
    return mean
