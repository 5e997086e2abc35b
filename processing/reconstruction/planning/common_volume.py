"""The grid to reconstruct on when nobody states one: the box that every view sees, one voxel per pixel."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from processing.geometry import FloatArray, ViewMapping
from processing.reconstruction.errors import ReconstructionError
from processing.volume import VoxelGrid

MOST_PX_PER_VOXEL = 2.0
"""Voxels are looked at in their middle: between wider ones, droplets of a few pixels are missed."""
LATTICE = 81
"""Points along x and y at which visibility is looked up."""
LEVELS = 17
"""Planes of z at which it is, and at which the box may begin and end."""


def common_volume(
    mappings: Sequence[ViewMapping],
    *,
    x_range_mm: tuple[float, float],
    y_range_mm: tuple[float, float],
    z_range_mm: tuple[float, float],
    pitch_mm: float | None = None,
) -> VoxelGrid:
    """Largest box that all views see completely.

    Parameters
    ----------
    mappings : sequence of ViewMapping
        One per view.
    x_range_mm, y_range_mm : tuple[float, float]
        Where to look for it: the mappings can be trusted here.
    z_range_mm : tuple[float, float]
        Calibrated range along z.
    pitch_mm : float, optional
        Voxel edge; by default one pixel of the finest view in the middle of the volume.

    Raises
    ------
    ReconstructionError
        The views have no volume in common.
    """
    if z_range_mm[0] >= z_range_mm[1]:
        raise ReconstructionError(f"the views share no range along z: it would go from {_both(z_range_mm)} mm")
    x_mm, y_mm = np.linspace(*x_range_mm, LATTICE), np.linspace(*y_range_mm, LATTICE)
    z_mm = np.linspace(*z_range_mm, LEVELS)
    seen = np.ones((LEVELS, LATTICE, LATTICE), dtype=bool)
    for level, height_mm in zip(seen, z_mm, strict=True):
        for mapping in mappings:
            level &= _visible(mapping, x_mm, y_mm, float(height_mm))
    box = largest_box(seen)
    if box is None:
        raise ReconstructionError(
            f"the {len(mappings)} views see no common volume within x {_both(x_range_mm)}, y {_both(y_range_mm)}, "
            f"z {_both(z_range_mm)} mm"
        )
    first, last, top, bottom, left, right = box
    lower_mm = np.array([x_mm[left], y_mm[top], z_mm[first]])
    upper_mm = np.array([x_mm[right], y_mm[bottom], z_mm[last]])
    if pitch_mm is None:
        pitch_mm = 1 / max(scale_px_per_mm(mapping, (lower_mm + upper_mm) / 2) for mapping in mappings)
    elif not pitch_mm > 0:
        raise ValueError(f"pitch {pitch_mm} mm: it must be above 0")
    nx, ny, nz = (int(extent_mm / pitch_mm) + 1 for extent_mm in upper_mm - lower_mm)
    return VoxelGrid((nz, ny, nx), (float(lower_mm[0]), float(lower_mm[1]), float(lower_mm[2])), float(pitch_mm))


def _both(range_mm: tuple[float, float]) -> str:
    return f"{range_mm[0]:g} to {range_mm[1]:g}"


def share_within(
    grid: VoxelGrid,
    x_range_mm: tuple[float, float],
    y_range_mm: tuple[float, float],
    z_range_mm: tuple[float, float],
) -> float:
    """Which part of a box lies within a grid, by volume; its faces are the outermost voxels' centres."""
    shares = []
    for within_mm, (low_mm, high_mm) in zip(
        (grid.x_mm, grid.y_mm, grid.z_mm), (x_range_mm, y_range_mm, z_range_mm), strict=True
    ):
        held_mm = min(within_mm[-1], high_mm) - max(within_mm[0], low_mm)
        shares.append(max(held_mm, 0.0) / (high_mm - low_mm))
    return float(np.prod(shares))


def too_coarse(mappings: Sequence[ViewMapping], grid: VoxelGrid) -> str:
    """What to say of voxels that are wider than ``MOST_PX_PER_VOXEL``; empty where they are not."""
    middle_mm = grid.to_mm((np.array([grid.shape]) - 1) / 2)[0]
    finest_px_per_mm = max(scale_px_per_mm(mapping, middle_mm) for mapping in mappings)
    if not (width_px := grid.pitch_mm * finest_px_per_mm) > MOST_PX_PER_VOXEL:
        return ""
    return (
        f"a voxel is {width_px:.2g} px wide, and looked at in its middle alone: droplets of a few pixels are missed or "
        f"pale; one voxel per pixel has a pitch of {1 / finest_px_per_mm:.3g} mm"
    )


def largest_box(seen: NDArray[np.bool_]) -> tuple[int, int, int, int, int, int] | None:
    """Largest all-true box of at least two levels: (first, last, top, bottom, left, right), inclusive.

    Parameters
    ----------
    seen : (levels, rows, columns) array
        None is the answer where there is no such box. Of boxes of one size the deepest is taken.
    """
    best_size, best = 0, None
    for depth in range(len(seen) - 1, 0, -1):
        for first in range(len(seen) - depth):
            mask = np.logical_and.reduce(seen[first : first + depth + 1])
            if depth * np.count_nonzero(mask) <= best_size or (rectangle := largest_rectangle(mask)) is None:
                continue
            top, bottom, left, right = rectangle
            size = depth * (bottom - top + 1) * (right - left + 1)
            if size > best_size:
                best_size, best = size, (first, first + depth, top, bottom, left, right)
    return best


def largest_rectangle(mask: NDArray[np.bool_]) -> tuple[int, int, int, int] | None:
    """Largest all-true rectangle of a mask: (top, bottom, left, right), inclusive; None where all is false."""
    best_area, best = 0, None
    columns = np.arange(mask.shape[1])
    for top in range(mask.shape[0]):
        free = np.logical_and.accumulate(mask[top:], axis=0)
        lengths = columns - np.maximum.accumulate(np.where(free, -1, columns), axis=1)
        longest = lengths.max(axis=1)
        areas = longest * np.arange(1, len(free) + 1)
        row = int(np.argmax(areas))
        if areas[row] > best_area:
            right = int(np.argmax(lengths[row]))
            best_area, best = int(areas[row]), (top, top + row, right - int(longest[row]) + 1, right)
    return best


def _visible(mapping: ViewMapping, x_mm: FloatArray, y_mm: FloatArray, z_mm: float) -> NDArray[np.bool_]:
    grid_x_mm, grid_y_mm = np.meshgrid(x_mm, y_mm)
    points_mm = np.column_stack([grid_x_mm.ravel(), grid_y_mm.ravel(), np.full(grid_x_mm.size, z_mm)])
    image_px = mapping.project(points_mm)
    inside: NDArray[np.bool_] = np.all((image_px >= 0) & (image_px <= np.array(mapping.image_size_px) - 1), axis=1)
    return inside.reshape(grid_x_mm.shape)


def scale_px_per_mm(mapping: ViewMapping, point_mm: FloatArray) -> float:
    """How large a view sees x or y at a point (3,), whichever it sees larger."""
    step_mm = 0.1
    seen_px = mapping.project(point_mm + step_mm * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]]))
    return float(np.linalg.norm(seen_px[1:] - seen_px[0], axis=1).max() / step_mm)
