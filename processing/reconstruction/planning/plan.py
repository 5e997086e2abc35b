"""Plan: all of a reconstruction that does not depend on the images, computed once per calibration and grid."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from processing.geometry import ViewMapping
from processing.kernels import DEFAULT_THREADS, _native
from processing.reconstruction.choices import Accuracy
from processing.reconstruction.errors import ReconstructionError
from processing.reconstruction.planning.fixed_point import FixedPoint
from processing.reconstruction.planning.node_view import NodeView, sample_mapping
from processing.reconstruction.planning.rectified_view import NotRectifiable, RectifiedView, rectify
from processing.volume import VoxelGrid

MIN_VIEWS = 2
MAX_DEVIATION_PX = 0.02
"""What a plan may add to the calibration error; a good calibration has 0.05 px."""


@dataclass(frozen=True, eq=False)
class Plan:
    """Where every view sees every voxel. Reused for all shots.

    Parameters
    ----------
    grid : VoxelGrid
        The volume to reconstruct.
    views : tuple
        One per mapping, in the same order: rectified where the camera is central, by nodes otherwise.
    names : tuple of str
        Of the views, for errors; by default their numbers, from 1.
    """

    grid: VoxelGrid
    views: tuple[RectifiedView | NodeView, ...]
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.names:
            object.__setattr__(self, "names", tuple(f"view {number}" for number in range(1, len(self.views) + 1)))

    @property
    def deviation_px(self) -> float:
        """Largest distance between the plan and the mappings it was made from."""
        return max(view.deviation_px for view in self.views)

    @property
    def resampled_bytes(self) -> int:
        """Memory that the resampled images of one exposure take."""
        return sum(2 * view.shape_px[0] * view.shape_px[1] for view in self.views)

    def between(self, planes: range) -> "Plan":
        """The same views of some planes z, of images that this plan resamples; the first one must have nodes."""
        nz, (x_mm, y_mm, z_mm) = len(planes), self.grid.origin_mm
        origin_mm = (x_mm, y_mm, z_mm + planes.start * self.grid.pitch_mm)
        grid = VoxelGrid((nz, *self.grid.shape[1:]), origin_mm, self.grid.pitch_mm)
        return replace(self, grid=grid, views=tuple(view.between(planes) for view in self.views))

    def empty_images(self) -> tuple[NDArray[np.int16], ...]:
        """Memory for the resampled images of one exposure; their pixels are undefined."""
        return tuple(np.empty(view.shape_px, np.int16) for view in self.views)

    def resample(
        self,
        images: Sequence[NDArray[np.float32]],
        threads: int = DEFAULT_THREADS,
        out: Sequence[NDArray[np.int16]] | None = None,
    ) -> list[FixedPoint]:
        """Bring recorded images into the form that the kernels sample.

        Parameters
        ----------
        images : sequence of (rows, columns) float32 arrays
            Inverted shadow intensities, one image per view; finite and not negative.
        threads : int
            The result does not depend on it.
        out : sequence of int16 arrays, optional
            Receive the images, which have the ``shape_px`` of the views; by default new ones.

        Raises
        ------
        ValueError
            Number or shape of the images do not fit the plan, or a pixel is negative, infinite or not a number.
        """
        memory = self.empty_images() if out is None else out
        if len(images) != len(self.views):
            raise ValueError(f"{len(images)} images for a plan of {len(self.views)} views")
        for name, image, view in zip(self.names, images, self.views, strict=True):
            if np.shape(image) != view.image_size_px[::-1]:
                raise ValueError(f"{name}: its image has shape {np.shape(image)}, its view {view.image_size_px[::-1]}")
        resampled = [
            view.resample(np.ascontiguousarray(image, dtype=np.float32), pixels, threads)
            for image, pixels, view in zip(images, memory, self.views, strict=True)
        ]
        for name, image, made in zip(self.names, images, resampled, strict=True):
            if not np.isfinite(made.unit):
                raise ValueError(f"{name}: {_first_fault(image)}; intensities are finite and not negative")
        return resampled

    def bind(self, resampled: Sequence[FixedPoint], *, cull: bool = True) -> list[_native.View]:
        """Resampled images with the geometry of their views, for the kernels.

        With ``cull`` the kernels look once where images are empty; without, their pixels may change later.
        """
        return [view.bind(image, cull=cull) for view, image in zip(self.views, resampled, strict=True)]


def plan_reconstruction(
    mappings: Sequence[ViewMapping],
    grid: VoxelGrid,
    accuracy: Accuracy = Accuracy.NOMINAL,
    names: Sequence[str] | None = None,
) -> Plan:
    """Plan the reconstruction of a grid from views of any mapping.

    Parameters
    ----------
    mappings : sequence of ViewMapping
        Two to eight views; their images may differ in size.
    grid : VoxelGrid
        The volume to reconstruct; a slice or a region of interest is a grid of its own.
    accuracy : Accuracy
        How finely rectified views are resampled.
    names : sequence of str, optional
        Of the views, for errors; by default their numbers, from 1.

    Raises
    ------
    ReconstructionError
        Too few or too many views, a mapping that is too rough to be sampled, or instructions asked for
        (``TOMOSHADOW_ISA``) that this processor does not have.
    """
    _check_instructions()
    if not MIN_VIEWS <= len(mappings) <= _native.MAX_VIEWS:
        raise ReconstructionError(f"{len(mappings)} views, a reconstruction takes {MIN_VIEWS} to {_native.MAX_VIEWS}")
    named = tuple(names or (f"view {number}" for number in range(1, len(mappings) + 1)))
    views = (_plan_named(name, mapping, grid, accuracy) for name, mapping in zip(named, mappings, strict=True))
    return Plan(grid, tuple(views), named)


def _first_fault(image: NDArray[np.float32]) -> str:
    row, column = np.argwhere(~((image >= 0) & np.isfinite(image)))[0]
    return f"pixel (column {column}, row {row}) is {image[row, column]}"


def _plan_named(name: str, mapping: ViewMapping, grid: VoxelGrid, accuracy: Accuracy) -> RectifiedView | NodeView:
    try:
        return plan_view(mapping, grid, accuracy)
    except ReconstructionError as error:
        raise type(error)(f"{name}: {error}") from error


def _check_instructions() -> None:
    """Complain of the environment before the work, and as an error that a user can mend."""
    try:
        _native.selected_isa()
    except ValueError as error:
        raise ReconstructionError(str(error)) from error


def plan_view(mapping: ViewMapping, grid: VoxelGrid, accuracy: Accuracy = Accuracy.NOMINAL) -> RectifiedView | NodeView:
    """Rectify the view where that is exact to ``MAX_DEVIATION_PX``; sample its mapping otherwise."""
    try:
        return rectify(mapping, grid, accuracy.pixels_per_voxel, MAX_DEVIATION_PX)
    except NotRectifiable as why:
        return replace(sample_mapping(mapping, grid, MAX_DEVIATION_PX), reason=str(why))
