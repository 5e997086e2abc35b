"""SMART and MART: refine the volume until its projections agree with the images."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from processing.count import require_count
from processing.kernels import DEFAULT_THREADS
from processing.reconstruction.line_of_sight import check_volume
from processing.reconstruction.planning.plan import Plan
from processing.reconstruction.settings import MOST_RELAXATION
from processing.reconstruction.smart_state import FirstGuess, SmartState
from processing.reconstruction.sparse_volume import SparseVolume

Volume = NDArray[np.float32]
Pixels = NDArray[np.float32]
Output = NDArray[Any]
Stop = Callable[[int, float], bool]


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
        """Intensities per voxel of path (z, y, x), ``out`` or float32; images are integrals of it along lines."""
        return self.sparse.dense() if self.out is None else self.out


def smart(
    plan: Plan,
    images: Sequence[Pixels],
    *,
    iterations: int = 20,
    relaxation: float = 1.0,
    least_gain: float = 0.0,
    stop: Stop | None = None,
    start: Volume | None = None,
    out: Output | None = None,
    memory: SmartResult | None = None,
    threads: int = DEFAULT_THREADS,
) -> SmartResult:
    """Simultaneous MART: all views correct the volume at once.

    Each iteration multiplies every voxel by the product over the views of (I / P)^(relaxation / n_views),
    where I is the image and P the projection of the volume, both sampled where the view sees the voxel; by 16 at most.
    Where P is I to half a count of the image, nothing is corrected. The scale of the images is that of the volume.

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
        Inverted shadow intensities, finite and not negative; one image per view.
    iterations : int
        At most so many; the paper found 20 to be enough.
    relaxation : float
        1 is the method of the paper; less converges slower and follows noise less.
    least_gain : float
        Stop after an iteration that lowered the residual by less than this share of it; 0 never does.
    stop : callable, optional
        Called with number of iterations done and residual; ends the iteration by returning True.
    start : (z, y, x) float32 array, optional
        First guess, not negative; MLOS by default, or its power 4 / n_views where there are more views.
        Its scale does not matter; where it is zero, the result is zero.
    out : (z, y, x) float32 or float16 array, optional
        Receives the volume. Without it only the blocks that are not empty are in memory until somebody asks for more.
    memory : SmartResult, optional
        An earlier result that nobody needs any more: it lends its memory, because fresh memory costs as much time as
        some iterations. To ask it for its voxels is an error from then on.
    threads : int
        The result does not depend on it.

    Returns
    -------
    SmartResult
        The volume, and the residual after every iteration.

    Raises
    ------
    ValueError
        Images, ``start`` or ``out`` do not fit the plan, a pixel is negative, infinite or not a number, or an option is
        out of range.
    """

    def iterate(state: SmartState) -> None:
        state.advance(update=state.views, project=state.views)

    end = _End(iterations, least_gain, stop)
    return _run(plan, images, iterate, relaxation, 1 / len(plan.views), end, start, out, memory, threads)


def mart(
    plan: Plan,
    images: Sequence[Pixels],
    *,
    iterations: int = 20,
    relaxation: float = 1.0,
    least_gain: float = 0.0,
    stop: Stop | None = None,
    start: Volume | None = None,
    out: Output | None = None,
    memory: SmartResult | None = None,
    threads: int = DEFAULT_THREADS,
) -> SmartResult:
    """MART by views: one after the other corrects the volume by (I / P)^relaxation, P projected anew for each.

    An iteration corrects by every view once. All else is as in ``smart``, but that ratios are not roots: where one view
    darkens and the next one brightens, their steps of 1 / 2048 weigh more. Three iterations differ from float64 by
    about 0.2 % of the volume and nowhere by more than 1.5 % of it, or a tenth of the brightest voxel.

    Parameters
    ----------
    plan, images, iterations, relaxation, least_gain, stop, start, out, memory, threads
        As ``smart`` takes them.

    Returns
    -------
    SmartResult
        The volume, and the residual after every iteration.

    Raises
    ------
    ValueError
        As ``smart`` does.
    """

    def iterate(state: SmartState) -> None:
        for view in state.views:
            following = [view + 1] if view + 1 < len(state.views) else state.views
            state.advance(update=[view], project=following)

    end = _End(iterations, least_gain, stop)
    return _run(plan, images, iterate, relaxation, 1.0, end, start, out, memory, threads)


@dataclass(frozen=True)
class _End:
    """When to stop."""

    iterations: int
    least_gain: float
    stop: Stop | None

    def __post_init__(self) -> None:
        require_count("iterations", self.iterations, 1)
        if not 0 <= self.least_gain < 1:
            raise ValueError(f"least_gain {self.least_gain} must be a share, 0 to 1")

    def reached(self, residuals: Sequence[float]) -> bool:
        done = len(residuals) - 1
        if done and self.stop is not None and self.stop(done, residuals[-1]):
            return True
        return done >= self.iterations or (
            done > 0 and self.least_gain > 0 and residuals[-1] > (1 - self.least_gain) * residuals[-2]
        )


def _run(
    plan: Plan,
    images: Sequence[Pixels],
    iterate: Callable[[SmartState], None],
    relaxation: float,
    share: float,
    end: _End,
    start: Volume | None,
    out: Output | None,
    memory: SmartResult | None,
    threads: int,
) -> SmartResult:
    require_count("threads", threads, 1)
    if not 0 < relaxation <= MOST_RELAXATION:
        raise ValueError(
            f"relaxation {relaxation} must be above 0, and at most {MOST_RELAXATION:g}: beyond, it diverges"
        )
    if out is not None:
        check_volume(out, plan, (np.float32, np.float16))
    guess = FirstGuess(start, memory.sparse if memory else None)
    state = SmartState(plan, images, guess, relaxation * share, threads)
    residuals = [state.residual]
    while not end.reached(residuals):
        iterate(state)
        residuals.append(state.residual)
    if out is not None:
        state.volume.dense(out, threads=threads)
    return SmartResult(state.volume, tuple(residuals), out)
