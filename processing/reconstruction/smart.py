"""SMART and MART: refine the volume until its projections agree with the images."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from processing.reconstruction.fixed_point import FixedPoint
from processing.reconstruction.kernels import _native
from processing.reconstruction.line_of_sight import check_volume
from processing.reconstruction.plan import DEFAULT_THREADS, Plan

Volume = NDArray[np.float32]
Pixels = NDArray[np.float32]
Output = NDArray[Any]
Stop = Callable[[int, float], bool]

NOTHING = np.float32(1e-7)
"""Projected intensity below which a pixel sees nothing."""
NEGLIGIBLE = 1e-8
"""Blocks in which MLOS is nowhere brighter than this share of what it could be stay empty."""
QUARTER = 0.25
"""The exponent of four views without relaxation."""
RATIO_COUNTS = 4096
"""Ratios are kept in 16 bit: up to 8, in steps of 1 / 4096. So much brighter a view makes a voxel at most at once."""


@dataclass(frozen=True, eq=False)
class SmartResult:
    """A volume and the way to it.

    Parameters
    ----------
    volume : (z, y, x) float32 or float16 array
        Intensities; their sum along a line of sight is the intensity of the image.
    residuals : tuple of float
        Norm of projections minus images over norm of the images: of the scaled start, then after every iteration.
    """

    volume: Output
    residuals: tuple[float, ...]


def smart(
    plan: Plan,
    images: Sequence[Pixels],
    *,
    iterations: int = 20,
    start: Volume | None = None,
    relaxation: float = 1.0,
    stop: Stop | None = None,
    out: Output | None = None,
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
    out : (z, y, x) float32 or float16 array, optional
        Receives the volume. Until the end only blocks that are not empty are in memory, in float32.
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
    out: Output | None = None,
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
    """The state of an iteration: blocks of the volume that are not empty, projections, ratio images."""

    def __init__(
        self, plan: Plan, images: Sequence[Pixels], start: Volume | None, out: Output | None, threads: int
    ) -> None:
        self._threads, self._plan, self._out = threads, plan, out
        if out is not None:
            check_volume(out, plan, (np.float32, np.float16))
        resampled = plan.resample(images, threads)
        self._images = [image.intensity for image in resampled]
        self._blocks = _first_guess(plan, resampled, threads) if start is None else _blocks_of(plan, start, threads)
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
        self._blocks.scale(float(factor), self._threads)
        for projection in self._projections:
            projection *= factor

    def correct(self, view: int, exponent: float) -> None:
        """Set the ratio image of a view from its latest projection."""
        projection = self._projections[view]
        ratio = self._images[view] / np.maximum(projection, NOTHING)
        if exponent == QUARTER:  # a hundred times faster than powers
            ratio = np.sqrt(np.sqrt(ratio, out=ratio), out=ratio)
        else:
            ratio **= np.float32(exponent)
        ratio *= projection > NOTHING
        self._ratios[view][:] = np.minimum(ratio * np.float32(RATIO_COUNTS) + np.float32(0.5), np.float32(32767))

    def advance(self, update: Sequence[int], project: Sequence[int]) -> None:
        """Multiply the volume by the ratios of some views, then project it onto some views."""
        numbers = range(len(self._views))
        projections = [self._projections[view] if view in project else None for view in numbers]
        self._blocks.smart_pass(self._views, [view in update for view in numbers], projections, self._threads)

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
        volume = np.empty(self._plan.grid.shape, np.float32) if self._out is None else self._out
        self._blocks.write(volume, self._threads)
        return SmartResult(volume, tuple(residuals))


def _first_guess(plan: Plan, resampled: Sequence[FixedPoint], threads: int) -> _native.Blocks:
    """MLOS, where it is not negligible."""
    brightest = float(np.prod([image.brightest for image in resampled]))
    return _native.Blocks.of_views(plan.bind(resampled), plan.grid.shape, NEGLIGIBLE * brightest, threads)


def _blocks_of(plan: Plan, start: Volume, threads: int) -> _native.Blocks:
    check_volume(start, plan, (np.float32,))
    return _native.Blocks.of_volume(start, threads)


def _checked(iterations: int, relaxation: float) -> float:
    if iterations < 1 or relaxation <= 0:
        raise ValueError(f"iterations {iterations} and relaxation {relaxation} must be positive")
    return relaxation
