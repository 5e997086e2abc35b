"""SMART and MART: refine the volume until its projections agree with the images."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.reconstruction.fixed_point import FixedPoint
from processing.reconstruction.kernels import _native
from processing.reconstruction.line_of_sight import check_volume, line_of_sight
from processing.reconstruction.method import ReconstructionMethod
from processing.reconstruction.plan import DEFAULT_THREADS, Plan

Volume = NDArray[np.float32]
Pixels = NDArray[np.float32]
Stop = Callable[[int, float], bool]

NOTHING = np.float32(1e-7)
"""Projected intensity below which a pixel sees nothing."""
RATIO_COUNTS = 4096
"""Ratios are kept in 16 bit: up to 8, in steps of 1 / 4096. So much brighter a view makes a voxel at most at once."""


@dataclass(frozen=True, eq=False)
class SmartResult:
    """A volume and the way to it.

    Parameters
    ----------
    volume : (z, y, x) float32 array
        Intensities; their sum along a line of sight is the intensity of the image.
    residuals : tuple of float
        Norm of projections minus images over norm of the images: of the scaled start, then after every iteration.
    """

    volume: Volume
    residuals: tuple[float, ...]


def smart(
    plan: Plan,
    images: Sequence[Pixels],
    *,
    iterations: int = 20,
    start: Volume | None = None,
    relaxation: float = 1.0,
    stop: Stop | None = None,
    out: Volume | None = None,
    threads: int = DEFAULT_THREADS,
) -> SmartResult:
    """Simultaneous MART: all views correct the volume at once.

    Each iteration multiplies every voxel by the product over the views of (I / P)^(relaxation / n_views),
    where I is the image and P the projection of the volume, both sampled where the view sees the voxel.

    Parameters
    ----------
    plan : Plan
        Geometry of views and grid.
    images : sequence of (rows, columns) float32 arrays
        Inverted shadow intensities, not negative; one image per view.
    iterations : int
        The paper found 20 to be enough.
    start : (z, y, x) float32 array, optional
        First guess, MLOS by default. Its scale does not matter; where it is zero, the result is zero.
    relaxation : float
        1 is the method of the paper; less converges slower and follows noise less.
    stop : callable, optional
        Called with number of iterations done and residual; ends the iteration by returning True.
    out : (z, y, x) float32 array, optional
        Receives the volume.
    threads : int
        The result does not depend on it.

    Raises
    ------
    ValueError
        Images, ``start`` or ``out`` do not fit the plan, or ``iterations`` or ``relaxation`` is not positive.
    """
    solver = _Solver(plan, images, start, out, threads)
    exponent = _checked(iterations, relaxation) / len(plan.views)
    everything = range(len(plan.views))

    def iterate() -> None:
        for view in everything:
            solver.correct(view, exponent)
        solver.advance(update=everything, project=everything)

    return solver.run(iterate, iterations, stop)


def mart(
    plan: Plan,
    images: Sequence[Pixels],
    *,
    iterations: int = 20,
    start: Volume | None = None,
    relaxation: float = 1.0,
    stop: Stop | None = None,
    out: Volume | None = None,
    threads: int = DEFAULT_THREADS,
) -> SmartResult:
    """MART by views: one after the other corrects the volume by (I / P)^relaxation, P projected anew for each.

    An iteration corrects by every view once. Parameters and errors are those of ``smart``.
    """
    solver = _Solver(plan, images, start, out, threads)
    exponent = _checked(iterations, relaxation)
    views = range(len(plan.views))

    def iterate() -> None:
        for view in views:
            solver.correct(view, exponent)
            following = [view + 1] if view + 1 < len(views) else views
            solver.advance(update=[view], project=following)

    return solver.run(iterate, iterations, stop)


class _Solver:
    """The state of an iteration: volume, projections, ratio images."""

    def __init__(
        self, plan: Plan, images: Sequence[Pixels], start: Volume | None, out: Volume | None, threads: int
    ) -> None:
        self._threads = threads
        self._images = [resampled.intensity for resampled in plan.resample(images, threads)]
        self.volume = np.empty(plan.grid.shape, dtype=np.float32) if out is None else out
        check_volume(self.volume, plan, (np.float32,))
        if start is None:
            line_of_sight(plan, images, ReconstructionMethod.MLOS, self.volume, threads=threads)
        else:
            check_volume(start, plan, (np.float32,))
            np.copyto(self.volume, start)
        self._projections = [np.zeros_like(image) for image in self._images]
        self._ratios = [np.zeros(image.shape, np.int16) for image in self._images]
        self._views = plan.bind([FixedPoint(ratio, 1 / RATIO_COUNTS) for ratio in self._ratios], cull=False)
        self.advance(update=[], project=range(len(self._views)))
        self._match_scale()

    def _match_scale(self) -> None:
        projected = sum(float(projection.sum(dtype=np.float64)) for projection in self._projections)
        if projected <= 0:
            return
        factor = np.float32(sum(float(image.sum(dtype=np.float64)) for image in self._images) / projected)
        self.volume *= factor
        for projection in self._projections:
            projection *= factor

    def correct(self, view: int, exponent: float) -> None:
        """Set the ratio image of a view from its latest projection."""
        projection = self._projections[view]
        ratio = (self._images[view] / np.maximum(projection, NOTHING)) ** np.float32(exponent)
        ratio[projection <= NOTHING] = 0
        self._ratios[view][:] = np.minimum(ratio * RATIO_COUNTS + np.float32(0.5), 32767)

    def advance(self, update: Sequence[int], project: Sequence[int]) -> None:
        """Multiply the volume by the ratios of some views, then project it onto some views."""
        numbers = range(len(self._views))
        projections = [self._projections[view] if view in project else None for view in numbers]
        flags = [view in update for view in numbers]
        _native.smart_pass(self._views, flags, projections, self.volume, self._threads)

    def residual(self) -> float:
        """Norm of the difference between projections and images, relative to the images."""
        pairs = list(zip(self._projections, self._images, strict=True))
        recorded = sum(float(np.vdot(image, image)) for _, image in pairs)
        missed = sum(float(np.sum((projection - image) ** 2, dtype=np.float64)) for projection, image in pairs)
        return float(np.sqrt(missed / recorded)) if recorded else 0.0

    def run(self, iterate: Callable[[], None], iterations: int, stop: Stop | None) -> SmartResult:
        """Iterate until done or stopped."""
        residuals = [self.residual()]
        for done in range(1, iterations + 1):
            iterate()
            residuals.append(self.residual())
            if stop is not None and stop(done, residuals[-1]):
                break
        return SmartResult(self.volume, tuple(residuals))


def _checked(iterations: int, relaxation: float) -> float:
    if iterations < 1 or relaxation <= 0:
        raise ValueError(f"iterations {iterations} and relaxation {relaxation} must be positive")
    return relaxation
