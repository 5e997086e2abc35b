"""SMART and MART: refine the volume until its projections agree with the images."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypedDict, Unpack

import numpy as np
from numpy.typing import NDArray

from processing.kernels import DEFAULT_THREADS
from processing.reconstruction.line_of_sight import check_volume
from processing.reconstruction.planning.plan import Plan
from processing.reconstruction.smart_state import FirstGuess, SmartState
from processing.reconstruction.sparse_volume import SparseVolume

Volume = NDArray[np.float32]
Pixels = NDArray[np.float32]
Output = NDArray[Any]
Stop = Callable[[int, float], bool]


class SmartOptions(TypedDict, total=False):
    """What ``smart`` and ``mart`` take, all of it optional.

    Parameters
    ----------
    iterations : int
        At most so many; 20 by default, which the paper found to be enough.
    relaxation : float
        1, the default, is the method of the paper; less converges slower and follows noise less.
    least_gain : float
        Stop after an iteration that lowered the residual by less than this share of it; 0, the default, never does.
    stop : callable
        Called with number of iterations done and residual; ends the iteration by returning True.
    start : (z, y, x) float32 array
        First guess, not negative; MLOS by default, or its power 4 / n_views where there are more views.
        Its scale does not matter; where it is zero, the result is zero.
    out : (z, y, x) float32 or float16 array
        Receives the volume. Without it only the blocks that are not empty are in memory until somebody asks for more.
    memory : SmartResult, optional
        An earlier result that nobody needs any more: it loses its voxels and lends its memory, because fresh memory
        costs as much time as some iterations.
    threads : int
        The result does not depend on it.
    """

    iterations: int
    relaxation: float
    least_gain: float
    stop: Stop
    start: Volume | None
    out: Output | None
    memory: "SmartResult | None"
    threads: int


@dataclass(frozen=True, eq=False)
class SmartResult:
    """A volume and the way to it.

    Parameters
    ----------
    sparse : SparseVolume
        The volume where it is not empty.
    residuals : tuple of float
        Norm of projections minus images over norm of the images: of the scaled start, then after every iteration.
    out : (z, y, x) array, optional
        The volume, where the caller wanted it to be.
    """

    sparse: SparseVolume
    residuals: tuple[float, ...]
    out: Output | None = None

    @cached_property
    def volume(self) -> Output:
        """Intensities (z, y, x), ``out`` or float32; their sum along a line of sight is the intensity of the image."""
        return self.sparse.dense() if self.out is None else self.out


def smart(plan: Plan, images: Sequence[Pixels], **options: Unpack[SmartOptions]) -> SmartResult:
    """Simultaneous MART: all views correct the volume at once.

    Each iteration multiplies every voxel by the product over the views of (I / P)^(relaxation / n_views),
    where I is the image and P the projection of the volume, both sampled where the view sees the voxel; by 16 at most.

    Three iterations differ from float64 by less than 1.5e-3 of the volume, as norms, and nowhere by more than 1e-2 of
    the brightest voxel: ratios have steps of 1 / 2048, and corrections round as float16 does. From MLOS, where blocks
    below 1e-8 of the brightest are not followed, it is 3e-3 and 2e-2.

    Views may see droplets that are not in the volume: voxels at its faces take their light, and become up to three
    times as bright as others.

    Parameters
    ----------
    plan : Plan
        Geometry of views and grid.
    images : sequence of (rows, columns) float32 arrays
        Inverted shadow intensities, not negative; one image per view.
    **options
        See ``SmartOptions``.

    Raises
    ------
    ValueError
        Images, ``start`` or ``out`` do not fit the plan, or an option is out of range.
    """

    def iterate(state: SmartState) -> None:
        state.advance(update=state.views, project=state.views)

    return _run(plan, images, iterate, 1 / len(plan.views), options)


def mart(plan: Plan, images: Sequence[Pixels], **options: Unpack[SmartOptions]) -> SmartResult:
    """MART by views: one after the other corrects the volume by (I / P)^relaxation, P projected anew for each.

    An iteration corrects by every view once. All else is as in ``smart``, but that ratios are not roots: where one view
    darkens and the next one brightens, their steps of 1 / 2048 weigh more. Three iterations differ from float64 by
    about 0.2 % of the volume and nowhere by more than 1.5 % of it, or a tenth of the brightest voxel.
    """

    def iterate(state: SmartState) -> None:
        for view in state.views:
            following = [view + 1] if view + 1 < len(state.views) else state.views
            state.advance(update=[view], project=following)

    return _run(plan, images, iterate, 1.0, options)


def _run(
    plan: Plan, images: Sequence[Pixels], iterate: Callable[[SmartState], None], share: float, options: SmartOptions
) -> SmartResult:
    iterations, threads = options.get("iterations", 20), options.get("threads", DEFAULT_THREADS)
    relaxation, least_gain = options.get("relaxation", 1.0), options.get("least_gain", 0.0)
    if iterations < 1 or relaxation <= 0:
        raise ValueError(f"iterations {iterations} and relaxation {relaxation} must be positive")
    if not 0 <= least_gain < 1:
        raise ValueError(f"least_gain {least_gain} must be a share, 0 to 1")
    stop, out = options.get("stop"), options.get("out")
    if out is not None:
        check_volume(out, plan, (np.float32, np.float16))
    memory = options.get("memory")
    start = FirstGuess(options.get("start"), memory.sparse if memory else None)
    state = SmartState(plan, images, start, relaxation * share, threads)
    residuals = [state.residual]
    for done in range(1, iterations + 1):
        iterate(state)
        residuals.append(state.residual)
        if stop is not None and stop(done, residuals[-1]):
            break
        if least_gain and residuals[-1] > (1 - least_gain) * residuals[-2]:
            break
    if out is not None:
        state.volume.dense(out, threads=threads)
    return SmartResult(state.volume, tuple(residuals), out)
