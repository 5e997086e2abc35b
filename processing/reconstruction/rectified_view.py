"""The fast way to see voxels: an image resampled once, of which every plane z is a scale and a shift.

Lines of sight of a central camera meet in one point C. A point P on the plane z lies on the same line of sight
as C + (P - C) (z_ref - C_z) / (z - C_z) on the plane z_ref. So the image is resampled once onto the plane z_ref,
through the full camera model with all its distortion; from there on no camera model is needed (shear-warp).
"""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.geometry import FloatArray, ViewMapping
from processing.reconstruction.kernels import _native
from processing.volume import VoxelGrid

Pixels = NDArray[np.float32]

GUARD_PX = 2
"""Pixels kept above and left of the volume."""
OVERHANG_PX = 68
"""Columns kept right of the volume, which the widest vectors may read."""
MIN_RELATIVE_SCALE = 0.6
"""Smallest scale of any plane against the largest one; beyond it the volume is too deep for its distance."""


@runtime_checkable
class CentralMapping(ViewMapping, Protocol):
    """A mapping whose lines of sight meet in one point."""

    @property
    def centre_mm(self) -> FloatArray:
        """Where they meet, (3,)."""


@dataclass(frozen=True, eq=False)
class RectifiedView:
    """A view whose image is resampled onto the plane z_ref, the middle of the volume.

    Parameters
    ----------
    map_u_px, map_v_px : (rows, columns) float32 arrays
        Where each pixel of the resampled image lies in the recorded one.
    scale : (nz,) float64 array
        Pixels of the resampled image per voxel, for each plane.
    shift_u_px, shift_v_px : (nz,) float64 arrays
        Where voxel (z, 0, 0) is seen in the resampled image.
    image_size_px : tuple[int, int]
        (width, height) of the recorded image.
    deviation_px : float
        Largest distance to the full camera model, in the recorded image.
    """

    map_u_px: Pixels
    map_v_px: Pixels
    scale: FloatArray
    shift_u_px: FloatArray
    shift_v_px: FloatArray
    image_size_px: tuple[int, int]
    deviation_px: float

    def resample(self, image: Pixels) -> Pixels:
        """The image on the plane z_ref: cubic, zero outside of the recorded image, never negative."""
        resampled = cv2.remap(image, self.map_u_px, self.map_v_px, cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT)
        return np.maximum(resampled, np.float32(0), dtype=np.float32)

    def bind(self, pixels: Pixels) -> _native.View:
        """A resampled image with the geometry of this view, for the kernels."""
        return _native.View.rectified(pixels, self.scale, self.shift_u_px, self.shift_v_px)


def rectify(mapping: ViewMapping, grid: VoxelGrid) -> RectifiedView | None:
    """Rectify a view for a grid; None where its lines of sight do not meet, or meet too near.

    The largest scale of all planes is one pixel per voxel.
    """
    if not isinstance(mapping, CentralMapping):
        return None
    centre = grid.to_index(np.asarray(mapping.centre_mm)[None])[0]
    z_ref = 0.5 * (grid.shape[0] - 1)
    depth = np.arange(grid.shape[0]) - centre[0]
    if depth[0] * depth[-1] <= 0 or (z_ref - centre[0]) == 0:
        return None
    to_reference = (z_ref - centre[0]) / depth
    scale = to_reference / to_reference.max()
    if scale.min() < MIN_RELATIVE_SCALE:
        return None
    reference_scale = 1 / to_reference.max()
    shift_v, shift_u = (reference_scale * centre[axis] * (1 - to_reference) for axis in (1, 2))
    left, top = GUARD_PX - shift_u.min(), GUARD_PX - shift_v.min()
    columns = int(np.ceil((shift_u + scale * (grid.shape[2] - 1)).max() + left)) + OVERHANG_PX
    rows = int(np.ceil((shift_v + scale * (grid.shape[1] - 1)).max() + top)) + 2 * GUARD_PX
    index_x, index_y = (np.arange(columns) - left) / reference_scale, (np.arange(rows) - top) / reference_scale
    map_px = _project_plane(mapping, grid, index_x, index_y, z_ref)
    return RectifiedView(
        map_u_px=np.ascontiguousarray(map_px[..., 0], dtype=np.float32),
        map_v_px=np.ascontiguousarray(map_px[..., 1], dtype=np.float32),
        scale=scale,
        shift_u_px=shift_u + left,
        shift_v_px=shift_v + top,
        image_size_px=mapping.image_size_px,
        deviation_px=_deviation_px(mapping, grid, centre, to_reference),
    )


def _project_plane(
    mapping: ViewMapping, grid: VoxelGrid, index_x: FloatArray, index_y: FloatArray, index_z: float
) -> FloatArray:
    y, x = np.meshgrid(index_y, index_x, indexing="ij")
    indices = np.stack([np.full(x.shape, index_z), y, x], axis=-1)
    return mapping.project(grid.to_mm(indices.reshape(-1, 3))).reshape(*x.shape, 2)


def _deviation_px(mapping: ViewMapping, grid: VoxelGrid, centre: FloatArray, to_reference: FloatArray) -> float:
    """Compare the way over the plane z_ref with the mapping itself, on a lattice of voxels."""
    axes = [np.unique(np.linspace(0, n - 1, 17).round()) for n in grid.shape]
    voxels = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    on_reference = centre + (voxels - centre) * to_reference[voxels[:, 0].astype(np.intp), None]
    difference_px = mapping.project(grid.to_mm(voxels)) - mapping.project(grid.to_mm(on_reference))
    return float(np.linalg.norm(difference_px, axis=1).max())
