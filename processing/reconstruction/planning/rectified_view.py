"""The fast way to see voxels: an image resampled once, of which every plane z is a scale and a shift.

Lines of sight of a central camera meet in one point C. A point P on the plane z lies on the same line of sight
as C + (P - C) (z_ref - C_z) / (z - C_z) on the plane z_ref. So the image is resampled once onto the plane z_ref,
through the full camera model with all its distortion; from there on no camera model is needed (shear-warp).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from processing.geometry import FloatArray, ViewMapping
from processing.kernels import _native
from processing.reconstruction.planning.bending import bend_px
from processing.reconstruction.planning.fixed_point import FixedPoint
from processing.volume import VoxelGrid

GUARD_PX = 2.025
"""Kept above and left of the volume. With 0.95 px per voxel, pixels come closer to voxels by 1 / 19 voxel from one to
the next; begun at 2.025 px, none comes closer than half of that. If one met a voxel, rounding would let it see a
millionth of the next one, which SMART then brightens until it explains all light of the pixel."""
LINES_PER_AXIS, LINES_BEYOND = 5, 4.0
"""Lines of sight that are asked where they meet; and voxels that they lie apart where the grid is but one voxel."""
MIN_COSINE = 0.342
"""Between line of sight and z axis: flatter ones pass droplets between two planes; at 80 deg SMART is off by 17 %."""
MAX_PATH_ERROR = 0.005
"""Of the length of a line of sight in one plane, by the point where all are said to meet."""
MAP_SPACING_PX = _native.MAP_SPACING_PX
"""Pixels of the resampled image from one evaluation of the camera model to the next; it is straight in between."""
MAX_PIXELS_PER_VOXEL = 1.5
"""Of the recorded image; coarser voxels would skip pixels."""
RESAMPLING_PX = 0.016
"""Largest displacement of a droplet by cubic convolution, if its standard deviation is 0.75 px or more."""
MIN_RELATIVE_SCALE = 0.63
"""Smallest scale of any plane against the largest one; beyond it the volume is too deep for its distance."""


class NotRectifiable(Exception):
    """A view cannot be rectified for a grid, or not exactly; the text says why."""


@dataclass(frozen=True, eq=False)
class RectifiedView:
    """A view whose image is resampled onto the plane z_ref, the middle of the volume.

    Parameters
    ----------
    shape_px : tuple[int, int]
        (rows, columns) of the resampled image.
    nodes_px : (node rows, node columns, 2) float32 array
        Where every ``MAP_SPACING_PX``-th pixel of the resampled image lies in the recorded one, (u, v).
    scale : (nz,) float64 array
        Pixels of the resampled image per voxel, for each plane.
    shift_u_px, shift_v_px : (nz,) float64 arrays
        Where voxel (z, 0, 0) is seen in the resampled image.
    foot : tuple[float, float, float]
        Column and row of the resampled image where its line of sight runs along z, and how many of its pixels the
        plane z_ref is away from where all lines of sight meet.
    image_size_px : tuple[int, int]
        (width, height) of the recorded image.
    deviation_px : float
        Largest distance to the full camera model, in the recorded image, and what resampling displaces.
    """

    shape_px: tuple[int, int]
    nodes_px: NDArray[np.float32]
    scale: FloatArray
    shift_u_px: FloatArray
    shift_v_px: FloatArray
    foot: tuple[float, float, float]
    image_size_px: tuple[int, int]
    deviation_px: float

    def between(self, planes: range) -> "RectifiedView":
        """The same view of some planes z."""
        some = slice(planes.start, planes.stop)
        return replace(self, scale=self.scale[some], shift_u_px=self.shift_u_px[some], shift_v_px=self.shift_v_px[some])

    def resample(self, image: NDArray[np.float32], out: NDArray[np.int16], threads: int) -> FixedPoint:
        """The image on the plane z_ref, in ``out``: cubic, zero outside of the recorded image, limited to its range.

        Its unit is not finite where a pixel is no intensity.
        """
        return FixedPoint(out, _native.resample(image, self.nodes_px, out, threads))

    def bind(self, image: FixedPoint, *, cull: bool) -> _native.View:
        """A resampled image with the geometry of this view, for the kernels."""
        return _native.View.rectified(
            image.pixels, image.unit, self.scale, self.shift_u_px, self.shift_v_px, self.foot, cull
        )


def rectify(mapping: ViewMapping, grid: VoxelGrid, pixels_per_voxel: float, max_deviation_px: float) -> RectifiedView:
    """Rectify a view for a grid; the largest scale of all planes is ``pixels_per_voxel``.

    Raises
    ------
    NotRectifiable
        Its lines of sight do not meet, or too near; voxels are coarse; or it would be off by more than
        ``max_deviation_px``, which is of the geometry alone.
    """
    centre, to_reference = _central_projection(mapping, grid)
    z_ref = 0.5 * (grid.shape[0] - 1)
    reference_scale = pixels_per_voxel / to_reference.max()
    scale = reference_scale * to_reference
    shift_v, shift_u = (reference_scale * centre[axis] * (1 - to_reference) for axis in (1, 2))
    left, top = GUARD_PX - shift_u.min(), GUARD_PX - shift_v.min()
    last_column = -(-grid.shape[2] // _native.BLOCK_COLUMNS) * _native.BLOCK_COLUMNS - 1
    columns = int(np.ceil((shift_u + scale * last_column).max() + left)) + _native.OVERHANG_COLUMNS
    columns += -columns % MAP_SPACING_PX
    rows = int(np.ceil((shift_v + scale * (grid.shape[1] - 1)).max() + top)) + _native.OVERHANG_ROWS
    origin = np.array([z_ref, -top / reference_scale, -left / reference_scale])
    points_at = partial(_project_plane, mapping, grid, origin, 1 / reference_scale, (rows, columns))
    nodes_px = points_at((0.0, 0.0))
    recorded_px_per_voxel = reference_scale * np.linalg.norm(np.diff(nodes_px, axis=1), axis=-1).mean() / MAP_SPACING_PX
    if recorded_px_per_voxel > MAX_PIXELS_PER_VOXEL:
        raise NotRectifiable(f"a voxel is {recorded_px_per_voxel:.2g} px wide, limit {MAX_PIXELS_PER_VOXEL} px")
    deviation_px = bend_px(nodes_px, points_at) + _deviation_px(mapping, grid, centre, to_reference)
    if deviation_px > max_deviation_px:
        raise NotRectifiable(f"rectified it would be off by {deviation_px:.2g} px, limit {max_deviation_px} px")
    foot_v, foot_u = reference_scale * centre[1:] + (top, left)
    return RectifiedView(
        shape_px=(rows, columns),
        nodes_px=np.ascontiguousarray(nodes_px, dtype=np.float32),
        scale=scale,
        shift_u_px=shift_u + left,
        shift_v_px=shift_v + top,
        foot=(float(foot_u), float(foot_v), float(reference_scale * abs(z_ref - centre[0]))),
        image_size_px=mapping.image_size_px,
        deviation_px=deviation_px + RESAMPLING_PX,
    )


def _central_projection(mapping: ViewMapping, grid: VoxelGrid) -> tuple[FloatArray, FloatArray]:
    """Voxel index (z, y, x) where lines of sight meet; and by what planes (nz,) are scaled onto the middle one."""
    voxels, along = _lines_of_sight(mapping, grid)
    centre = _meeting_point(voxels, along)
    depth = np.arange(grid.shape[0]) - centre[0]
    if depth[0] * depth[-1] <= 0:
        raise NotRectifiable("its lines of sight meet beside the volume, or inside")
    flattest = float(np.abs(along[:, 0]).min())
    if flattest < MIN_COSINE:
        angles_deg = np.rad2deg(np.arccos([flattest, MIN_COSINE]))
        raise NotRectifiable("it looks {:.0f} deg beside the z axis, limit {:.0f} deg".format(*angles_deg))
    inclined = np.abs((voxels - centre)[:, 0]) / np.linalg.norm(voxels - centre, axis=1) / np.abs(along[:, 0])
    if not np.abs(inclined - 1).max() < MAX_PATH_ERROR:
        raise NotRectifiable("its lines of sight do not meet in one point")
    to_reference: FloatArray = (0.5 * (grid.shape[0] - 1) - centre[0]) / depth
    relative_scale = to_reference.min() / to_reference.max()
    if relative_scale < MIN_RELATIVE_SCALE:
        raise NotRectifiable(
            f"the far end of the volume is seen at {relative_scale:.2f} of the scale of the near end, "
            f"limit {MIN_RELATIVE_SCALE}"
        )
    return centre, to_reference


def _lines_of_sight(mapping: ViewMapping, grid: VoxelGrid) -> tuple[FloatArray, FloatArray]:
    """Voxel indices (N, 3) all over the grid, and unit vectors (N, 3) along which their image points stay."""
    axes = [np.linspace(-LINES_BEYOND, n - 1 + LINES_BEYOND, LINES_PER_AXIS) for n in grid.shape]
    voxels = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    with np.errstate(all="ignore"):  # a mapping may run away: then there are no numbers, and no point where lines meet
        slopes = np.stack([_seen(mapping, grid, voxels + d) - _seen(mapping, grid, voxels - d) for d in np.eye(3)])
        along = np.cross(slopes[:, :, 0], slopes[:, :, 1], axis=0).T
        return voxels, along / np.linalg.norm(along, axis=1, keepdims=True)


def _seen(mapping: ViewMapping, grid: VoxelGrid, voxels: FloatArray) -> FloatArray:
    return mapping.project(grid.to_mm(voxels))


def _meeting_point(points: FloatArray, along: FloatArray) -> FloatArray:
    """The point (3,) that is nearest to all lines, as the sum of squared distances goes."""
    across = np.eye(3) - along[:, :, None] * along[:, None, :]
    try:
        return np.asarray(np.linalg.solve(across.sum(axis=0), np.einsum("nij,nj->i", across, points)))
    except np.linalg.LinAlgError as error:
        raise NotRectifiable("its lines of sight are parallel") from error


def _project_plane(
    mapping: ViewMapping,
    grid: VoxelGrid,
    origin: FloatArray,
    voxels_per_px: float,
    shape: tuple[int, int],
    offset: Sequence[float],
) -> FloatArray:
    """Where nodes of the resampled image, whose pixel (0, 0) is the voxel index ``origin``, lie in the recorded one."""
    along_v, along_u = (
        voxels_per_px * MAP_SPACING_PX * (np.arange((n - 1) // MAP_SPACING_PX + 2) + along)
        for n, along in zip(shape, offset, strict=True)
    )
    y, x = np.meshgrid(origin[1] + along_v, origin[2] + along_u, indexing="ij")
    indices = np.stack([np.full(x.shape, origin[0]), y, x], axis=-1)
    return _seen(mapping, grid, indices.reshape(-1, 3)).reshape(*x.shape, 2)


def _deviation_px(mapping: ViewMapping, grid: VoxelGrid, centre: FloatArray, to_reference: FloatArray) -> float:
    """Compare the way over the plane z_ref with the mapping itself, on a lattice of voxels."""
    axes = [np.unique(np.linspace(0, n - 1, 17).round()) for n in grid.shape]
    voxels = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    on_reference = centre + (voxels - centre) * to_reference[voxels[:, 0].astype(np.intp), None]
    difference_px = _seen(mapping, grid, voxels) - _seen(mapping, grid, on_reference)
    return float(np.linalg.norm(difference_px, axis=1).max())
