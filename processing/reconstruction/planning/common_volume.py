"""The grid to reconstruct on when nobody states one: the box that every view sees, one voxel per pixel."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from processing.geometry import FloatArray, ViewMapping
from processing.reconstruction.errors import ReconstructionError
from processing.volume import VoxelGrid

LATTICE = 81
"""Points per axis at which visibility is looked up."""


def common_volume(
    mappings: Sequence[ViewMapping],
    *,
    x_range_mm: tuple[float, float],
    y_range_mm: tuple[float, float],
    z_range_mm: tuple[float, float],
    pitch_mm: float | None = None,
) -> VoxelGrid:
    """Largest box with z faces at ``z_range_mm`` that all views see completely.

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
    seen = np.ones((LATTICE, LATTICE), dtype=bool)
    for z_mm in np.linspace(*z_range_mm, 5):
        for mapping in mappings:
            seen &= _visible(mapping, x_mm, y_mm, float(z_mm))
    box = largest_rectangle(seen)
    if box is None:
        raise ReconstructionError(
            f"the {len(mappings)} views see no common volume within x {_both(x_range_mm)}, y {_both(y_range_mm)}, "
            f"z {_both(z_range_mm)} mm"
        )
    top, bottom, left, right = box
    lower_mm = np.array([x_mm[left], y_mm[top], z_range_mm[0]])
    upper_mm = np.array([x_mm[right], y_mm[bottom], z_range_mm[1]])
    pitch_mm = pitch_mm or 1 / max(scale_px_per_mm(mapping, (lower_mm + upper_mm) / 2) for mapping in mappings)
    nx, ny, nz = (int(extent_mm / pitch_mm) + 1 for extent_mm in upper_mm - lower_mm)
    return VoxelGrid((nz, ny, nx), (float(lower_mm[0]), float(lower_mm[1]), float(lower_mm[2])), float(pitch_mm))


def _both(range_mm: tuple[float, float]) -> str:
    return f"{range_mm[0]:g} to {range_mm[1]:g}"


def largest_rectangle(mask: NDArray[np.bool_]) -> tuple[int, int, int, int] | None:
    """Largest all-true rectangle of a mask: (top, bottom, left, right), inclusive; None where all is false."""
    best_area, best = 0, None
    for top in range(mask.shape[0]):
        columns = mask[top].copy()
        for bottom in range(top, mask.shape[0]):
            columns &= mask[bottom]
            left, right = _longest_run(columns)
            area = (bottom - top + 1) * (right - left)
            if area > best_area:
                best_area, best = area, (top, bottom, left, right - 1)
    return best


def _longest_run(flags: NDArray[np.bool_]) -> tuple[int, int]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    starts, ends = edges[::2], edges[1::2]
    if not len(starts):
        return 0, 0
    longest = int(np.argmax(ends - starts))
    return int(starts[longest]), int(ends[longest])


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
