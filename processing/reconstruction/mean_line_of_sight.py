"""The mean volume of many exposures, without a volume for each of them."""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from processing.kernels import DEFAULT_THREADS, _native
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.line_of_sight import check_brightness, check_method, check_volume
from processing.reconstruction.planning.plan import Plan

BATCH_BYTES, BATCH_EXPOSURES = 1 << 30, 128
"""Most of resampled images in memory at the same time; the volume is read and written once for each batch."""

Exposure = Sequence[NDArray[np.float32]]


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
    mean.fill(0)
    count, coming = 0, iter(exposures)
    fitting = max(1, min(BATCH_EXPOSURES, BATCH_BYTES // plan.resampled_bytes))
    memory = [plan.empty_images() for _ in range(fitting)]

    def bound(images: Exposure, own: Sequence[NDArray[np.int16]]) -> list[_native.View]:
        seen = plan.resample(images, threads, own)
        check_brightness(seen, method, mean.dtype)
        return plan.bind(seen)

    # in this order: where the memory ends, no exposure is taken
    while batch := [bound(one, own) for own, one in zip(memory, coming, strict=False)]:
        _native.sum_of_sight(batch, method, mean, threads)
        count += len(batch)
    if not count:
        raise ValueError("a mean needs one exposure or more")
    mean /= np.float32(count)
    return mean
