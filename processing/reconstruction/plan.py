"""Plan: all of a reconstruction that does not depend on the images, computed once per calibration and grid."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from processing.geometry import ViewMapping
from processing.reconstruction.kernels import _native
from processing.reconstruction.node_view import NodeView, sample_mapping
from processing.reconstruction.rectified_view import Pixels, RectifiedView, rectify
from processing.volume import VoxelGrid

MIN_VIEWS, MAX_VIEWS = 2, 8
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
    """

    grid: VoxelGrid
    views: tuple[RectifiedView | NodeView, ...]

    @property
    def deviation_px(self) -> float:
        """Largest distance between the plan and the mappings it was made from."""
        return max(view.deviation_px for view in self.views)

    def resample(self, images: Sequence[Pixels]) -> list[Pixels]:
        """Bring recorded images into the form that the kernels sample.

        Parameters
        ----------
        images : sequence of (rows, columns) float32 arrays
            Inverted shadow intensities, one image per view.

        Raises
        ------
        ValueError
            Number or shape of the images do not fit the plan.
        """
        if len(images) != len(self.views):
            raise ValueError(f"{len(images)} images for a plan of {len(self.views)} views")
        for number, (image, view) in enumerate(zip(images, self.views, strict=True)):
            if np.shape(image) != view.image_size_px[::-1]:
                raise ValueError(f"image {number} has shape {np.shape(image)}, its view {view.image_size_px[::-1]}")
        return [
            view.resample(np.ascontiguousarray(image, dtype=np.float32))
            for image, view in zip(images, self.views, strict=True)
        ]

    def bind(self, resampled: Sequence[Pixels]) -> list[_native.View]:
        """Resampled images with the geometry of their views, for the kernels."""
        return [view.bind(pixels) for view, pixels in zip(self.views, resampled, strict=True)]


def plan_reconstruction(mappings: Sequence[ViewMapping], grid: VoxelGrid) -> Plan:
    """Plan the reconstruction of a grid from views of any mapping.

    Parameters
    ----------
    mappings : sequence of ViewMapping
        Two to eight views; their images may differ in size.
    grid : VoxelGrid
        The volume to reconstruct; a slice or a region of interest is a grid of its own.

    Raises
    ------
    ValueError
        Too few or too many views, or a mapping that is too rough to be sampled.
    """
    if not MIN_VIEWS <= len(mappings) <= MAX_VIEWS:
        raise ValueError(f"{len(mappings)} views, a reconstruction takes {MIN_VIEWS} to {MAX_VIEWS}")
    return Plan(grid, tuple(plan_view(mapping, grid) for mapping in mappings))


def plan_view(mapping: ViewMapping, grid: VoxelGrid) -> RectifiedView | NodeView:
    """Rectify the view where that is exact to ``MAX_DEVIATION_PX``; sample its mapping otherwise."""
    rectified = rectify(mapping, grid)
    if rectified is not None and rectified.deviation_px <= MAX_DEVIATION_PX:
        return rectified
    return sample_mapping(mapping, grid, MAX_DEVIATION_PX)
