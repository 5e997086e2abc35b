"""SmartState: what an iteration of SMART changes. ``smart`` says which views correct, and when."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import frexp

import numpy as np
from numpy.typing import NDArray

from processing.kernels import _native
from processing.reconstruction.line_of_sight import check_volume
from processing.reconstruction.planning.fixed_point import FixedPoint
from processing.reconstruction.planning.plan import Plan
from processing.reconstruction.sparse_volume import FAR_FROM_ONE, SparseVolume

Image = NDArray[np.float32]

START_VIEWS = 4
"""The product of more views spans more than float16 does; the power 4 / n_views of it is as bright as that of four."""
DARK_UNIT = 1 / 32767
RATIO_COUNTS = 2048
"""Ratios are kept in 16 bit: up to 16, in steps of 1 / 2048. So much brighter a view makes a voxel at most at once:
with 8 and finer steps, voxels that start with nearly nothing lag behind, which costs more than the steps do."""


@dataclass(frozen=True, eq=False)
class FirstGuess:
    """What SMART starts from.

    Parameters
    ----------
    volume : (z, y, x) float32 array, optional
        MLOS by default; it is scaled to the sum of the images.
    memory : SparseVolume, optional
        It becomes empty and lends its memory.
    """

    volume: Image | None = None
    memory: SparseVolume | None = None


class SmartState:
    """The volume where it is not empty, its projections, and the ratio images that correct it.

    Parameters
    ----------
    plan : Plan
        Geometry of views and grid.
    images : sequence of (rows, columns) float32 arrays
        One per view.
    start : FirstGuess
        Of the volume.
    exponent : float
        A voxel is multiplied by (I / P)^exponent.
    threads : int
        The result does not depend on it.
    """

    def __init__(self, plan: Plan, images: Sequence[Image], start: FirstGuess, exponent: float, threads: int) -> None:
        self._exponent, self._threads = exponent, threads
        self._images, scale = _normalised(plan.resample(images, threads))
        self.volume = _first_guess(plan, self._images, start, scale, threads)
        self._ratios = [np.zeros(image.pixels.shape, np.int16) for image in self._images]
        views = plan.bind([FixedPoint(ratio, 1 / RATIO_COUNTS) for ratio in self._ratios], cull=False)
        self._projections = _native.Projections(views, plan.grid.shape)
        self._missed = [0.0] * len(views)
        self._recorded = sum(_energy(image) for image in self._images)
        self._project(update=[], project=self.views)
        self._match_scale()
        self._correct(self.views)

    @property
    def views(self) -> range:
        """Numbers of the views."""
        return range(len(self._images))

    @property
    def residual(self) -> float:
        """Norm of the difference between the latest projections and the images, relative to the images."""
        return float(np.sqrt(sum(self._missed) / self._recorded)) if self._recorded else 0.0

    def advance(self, update: Sequence[int], project: Sequence[int]) -> None:
        """Multiply the volume by the ratios of some views, then set the ratios of some from its new projections."""
        self._project(update, project)
        self._correct(project)

    def _project(self, update: Sequence[int], project: Sequence[int]) -> None:
        updated, projected = ([view in chosen for view in self.views] for chosen in (update, project))
        self._projections.smart_pass(self.volume.blocks, updated, projected, self._threads)

    def _match_scale(self) -> None:
        projected = self.volume.blocks.unit * sum(self._projections.sum(view) for view in self.views)
        recorded = sum(image.unit * float(image.pixels.sum(dtype=np.int64)) for image in self._images)
        if projected > 0 and recorded > 0:
            self.volume.blocks.scale(recorded / projected)

    def _correct(self, views: Sequence[int]) -> None:
        for view in views:
            image, ratio = self._images[view], self._ratios[view]
            self._missed[view] = self._projections.correct(
                view,
                self.volume.blocks.unit,
                image.pixels,
                image.unit,
                exponent=self._exponent,
                ratio_counts=RATIO_COUNTS,
                ratio=ratio,
                threads=self._threads,
            )


def _normalised(images: Sequence[FixedPoint]) -> tuple[list[FixedPoint], float]:
    """The images over a power of two, and that power: their brightest pixel is 1/2 to 1, as the kernels want it.

    A dark image has no brightness of its own.
    """
    lit = [bool(image.pixels.any()) for image in images]
    brightest = max((image.brightest for image, any_light in zip(images, lit, strict=True) if any_light), default=1.0)
    scale = 2.0 ** frexp(brightest)[1]
    units = (image.unit / scale if any_light else DARK_UNIT for image, any_light in zip(images, lit, strict=True))
    return [FixedPoint(image.pixels, unit) for image, unit in zip(images, units, strict=True)], scale


def _energy(image: FixedPoint) -> float:
    rows = (float(np.vdot(row, row)) for row in image.pixels.astype(np.float64))
    return image.unit**2 * sum(rows)


def _first_guess(
    plan: Plan, resampled: Sequence[FixedPoint], start: FirstGuess, scale: float, threads: int
) -> SparseVolume:
    volume = start.volume
    if volume is None:
        exponent = min(1.0, START_VIEWS / len(resampled))
        found = SparseVolume.of_sight(plan, resampled, exponent, threads=threads, memory=start.memory)
        return replace(found, unit=scale)
    check_volume(volume, plan, (np.float32,))
    least, most = float(volume.min()), float(volume.max())
    if not (least >= 0 and np.isfinite(most)):
        raise ValueError(f"start must not be negative and finite, its values are {least} to {most}")
    near_one = volume if 1 / FAR_FROM_ONE <= most <= FAR_FROM_ONE else np.ldexp(volume, -frexp(most)[1])
    return replace(SparseVolume.of(near_one, threads=threads, memory=start.memory), unit=scale)
