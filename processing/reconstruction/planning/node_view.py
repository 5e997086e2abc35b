"""The general way to see voxels: the mapping itself on a lattice of nodes, linear in between.

Any smooth mapping will do: polynomials, refracting windows, any roll, mirrors.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from processing.geometry import FloatArray, ViewMapping
from processing.kernels import _native
from processing.reconstruction.errors import RoughMapping
from processing.reconstruction.planning.bending import bend_px
from processing.reconstruction.planning.fixed_point import FixedPoint
from processing.volume import VoxelGrid

MAX_PIXELS_PER_VOXEL = 1.1
"""A projected voxel covers its four nearest pixels; where voxels are coarser, images are averaged first."""
FRAME_BEFORE_PX, FRAME_AFTER_PX = 1, 2
"""Zeros around an image, so that every position has four neighbours."""


@dataclass(frozen=True, eq=False)
class NodeView:
    """A view by its mapping at every ``spacing``-th voxel.

    Parameters
    ----------
    nodes : (3, nodes_z, nodes_y, nodes_x) float32 array
        Column and row in px, in the averaged image with its frame; and the area of a voxel in px^2, seen along the
        line of sight.
    spacing : int
        Voxels from node to node.
    binning : int
        Images are averaged over this many pixels squared.
    image_size_px : tuple[int, int]
        (width, height) of the recorded image.
    deviation_px : float
        Largest distance to the mapping between the nodes, in the recorded image.
    reason : str
        Why the view is not rectified.
    """

    nodes: NDArray[np.float32]
    spacing: int
    binning: int
    image_size_px: tuple[int, int]
    deviation_px: float
    reason: str = "asked for"

    @property
    def shape_px(self) -> tuple[int, int]:
        """(rows, columns) of the averaged image with its frame."""
        width, height = (n // self.binning + FRAME_BEFORE_PX + FRAME_AFTER_PX for n in self.image_size_px)
        return height, width

    def between(self, planes: range) -> "NodeView":
        """The same view of some planes z, of which the first one has nodes; ValueError if it has none."""
        if planes.start % self.spacing:
            raise ValueError(f"planes from {planes.start} on, nodes are at every {self.spacing}th")
        return replace(self, nodes=np.ascontiguousarray(self.nodes[:, planes.start // self.spacing :]))

    def resample(self, image: NDArray[np.float32], out: NDArray[np.int16], threads: int) -> FixedPoint:
        """The image, averaged and framed with zeros, in ``out``.

        Its unit is not finite where a pixel is no intensity.
        """
        if self.binning > 1:
            if not (image.min() >= 0 and image.max() < np.inf):
                return FixedPoint(out, np.nan)
            height, width = (n // self.binning * self.binning for n in image.shape)
            blocks = image[:height, :width].reshape(height // self.binning, self.binning, -1, self.binning)
            image = blocks.mean(axis=(1, 3), dtype=np.float32)
        return FixedPoint(out, _native.quantise(image, FRAME_BEFORE_PX, FRAME_AFTER_PX, out, threads))

    def bind(self, image: FixedPoint, *, cull: bool) -> _native.View:
        """A resampled image with the geometry of this view, for the kernels."""
        return _native.View.mapped(image.pixels, image.unit, self.nodes, self.spacing, cull)


def sample_mapping(mapping: ViewMapping, grid: VoxelGrid, max_deviation_px: float) -> NodeView:
    """Sample a mapping as densely as it takes to know it everywhere to ``max_deviation_px``.

    Raises
    ------
    RoughMapping
        It is too rough even for nodes two voxels apart.
    """
    deviation_px = np.inf
    for spacing in _native.NODE_SPACINGS:
        nodes_px = project_lattice(mapping, grid, spacing)
        deviation_px = bend_px(nodes_px, partial(project_lattice, mapping, grid, spacing))
        if deviation_px <= max_deviation_px:
            return _node_view(mapping, nodes_px, spacing, deviation_px)
    raise RoughMapping(
        f"mapping is not smooth: it bends by {deviation_px:.3g} px within {_native.NODE_SPACINGS[-1]} voxels, "
        f"limit {max_deviation_px} px; does the grid reach beyond what was calibrated?"
    )


def _node_view(mapping: ViewMapping, nodes_px: FloatArray, spacing: int, deviation_px: float) -> NodeView:
    along_z, along_y, along_x = (np.gradient(nodes_px, spacing, axis=axis) for axis in (0, 1, 2))
    pixels_per_voxel = max(float(np.linalg.norm(step, axis=-1).max()) for step in (along_x, along_y))
    binning = int(np.ceil(pixels_per_voxel / MAX_PIXELS_PER_VOXEL))
    gradient_u, gradient_v = np.moveaxis(np.stack([along_x, along_y, along_z], axis=-1), -2, 0)
    area = np.linalg.norm(np.cross(gradient_u, gradient_v), axis=-1) / binning**2
    framed_px = (nodes_px - 0.5 * (binning - 1)) / binning + FRAME_BEFORE_PX
    return NodeView(
        nodes=np.ascontiguousarray(np.stack([framed_px[..., 0], framed_px[..., 1], area]), dtype=np.float32),
        spacing=spacing,
        binning=binning,
        image_size_px=mapping.image_size_px,
        deviation_px=deviation_px,
    )


def project_lattice(
    mapping: ViewMapping, grid: VoxelGrid, spacing: int, offset: Sequence[float] = (0.0, 0.0, 0.0)
) -> FloatArray:
    """Image points (nodes_z, nodes_y, nodes_x, 2) of every ``spacing``-th voxel; the last nodes enclose the grid."""
    axes = [spacing * (np.arange((n - 1) // spacing + 2) + along) for n, along in zip(grid.shape, offset, strict=True)]
    indices = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return mapping.project(grid.to_mm(indices.reshape(-1, 3))).reshape(indices.shape[:3] + (2,))
