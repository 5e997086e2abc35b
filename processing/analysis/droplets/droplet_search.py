"""DropletSearch: where droplets are looked for, and how the views see it. Made once per calibration and grid."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.sight_lattice import SightLattice, sight_lattice
from processing.geometry import FloatArray, ViewMapping
from processing.kernels import _native
from processing.reconstruction.errors import ReconstructionError, RoughMapping
from processing.reconstruction.planning.common_volume import scale_px_per_mm
from processing.reconstruction.planning.plan import Plan, plan_reconstruction
from processing.volume import VoxelGrid

Window = tuple[slice, slice]
"""Rows and columns of an image."""
MARGIN_VOXEL = 20
"""Droplets that are seen, but not looked for, become ghosts: so far around the grid they are looked for too."""
LEAST_PX_PER_VOXEL, MOST_PX_PER_VOXEL = 0.4, 1.3
HULL_SHIFT = 4
"""Bits of a pixel to which outlines in images are drawn."""


def keep_on() -> None:
    """Before a round of a search, who waits may raise what ends it; this one does not."""


BEYOND_VOXEL = 1.5
"""A droplet that leaves what is searched farther than this is dropped."""
CANDIDATE_PITCH_VOXEL = 1.5
"""Candidates need be no nearer to their droplet: the fit moves them."""


@dataclass(frozen=True, eq=False)
class DropletSearch:
    """A grid, and around it a margin, as the views see them.

    Parameters
    ----------
    grid : VoxelGrid
        Droplets in it are measured.
    searched : VoxelGrid
        The same with its margin; positions in voxels are indices of this one.
    lattice : SightLattice
        Where the views see it.
    plan : Plan
        Of a coarser grid, for candidates.
    names : tuple of str
        Of the views.
    """

    grid: VoxelGrid
    searched: VoxelGrid
    lattice: SightLattice
    plan: Plan
    names: tuple[str, ...]

    def places_at(self, shares: FloatArray) -> FloatArray:
        """Points (N, 3) x, y, z in voxels of what is searched; given as shares of the grid, from 0 to 1."""
        margin_voxel = 0.5 * (np.array(self.searched.shape) - np.array(self.grid.shape))[::-1]
        return np.asarray(margin_voxel - 0.5 + shares * np.array(self.grid.shape[::-1]), dtype=np.float64)

    @property
    def ends_voxel(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper end (3,) of the grid, x, y, z in voxels of what is searched."""
        return self.places_at(np.zeros(3)), self.places_at(np.ones(3))

    def holds(self, positions_voxel: FloatArray) -> NDArray[np.bool_]:
        """Which positions (N, 3), x, y, z in voxels of what is searched, lie in the grid."""
        low, high = self.ends_voxel
        return np.asarray(np.all((positions_voxel >= low) & (positions_voxel < high), axis=1))

    def reaches(self, positions_voxel: FloatArray) -> NDArray[np.bool_]:
        """Which positions (N, 3), x, y, z in voxels of what is searched, lie in it, or little beyond."""
        most = np.array(self.searched.shape[::-1]) - 1 + BEYOND_VOXEL
        return np.asarray(np.all((positions_voxel > -BEYOND_VOXEL) & (positions_voxel < most), axis=1))

    def pixels_into_search(self) -> list[NDArray[np.bool_]]:
        """Pixels (rows, columns) of each view that look into what is searched; what others see is not searched for."""
        return self._pixels(0)

    def pixels_into_grid(self) -> list[NDArray[np.bool_]]:
        """Those that look into the grid: what lies just outside of what is searched does not reach them."""
        margin_voxel = (self.searched.shape[0] - self.grid.shape[0]) / 2
        return self._pixels(int(margin_voxel * self.lattice.pixels_per_voxel))

    def windows(self) -> tuple[Window, ...]:
        """Rows and columns of each view that hold the pixels into the search: of a box it is a small part."""
        return tuple(map(_window, self.pixels_into_search()))

    def _pixels(self, inset_px: int) -> list[NDArray[np.bool_]]:
        return [
            _hull(nodes_px.reshape(-1, 2), view.image_size_px, inset_px)
            for nodes_px, view in zip(self.lattice.nodes_px, self.plan.views, strict=True)
        ]


def _window(chosen: NDArray[np.bool_]) -> Window:
    """A window around chosen pixels (rows, columns), at least as wide as a droplet can be; all where there are none."""
    return _span(np.logical_or.reduce(chosen, axis=1)), _span(np.logical_or.reduce(chosen, axis=0))


def _span(chosen: NDArray[np.bool_]) -> slice:
    if not chosen.any():
        return slice(0, len(chosen))
    first = min(int(chosen.argmax()), len(chosen) - _native.MAX_BLOB_WINDOW_PX)
    return slice(first, max(len(chosen) - int(chosen[::-1].argmax()), first + _native.MAX_BLOB_WINDOW_PX))


def _hull(points_px: FloatArray, image_size_px: tuple[int, int], inset_px: int) -> NDArray[np.bool_]:
    """Pixels within the convex hull of points (N, 2), and so far from its edge; the edge of the image is none."""
    width_px, height_px = image_size_px
    outline = cv2.convexHull(points_px.astype(np.float32))
    inside = np.zeros((height_px, width_px), np.uint8)
    cv2.fillConvexPoly(inside, np.rint(outline * 2**HULL_SHIFT).astype(np.int32), 1, shift=HULL_SHIFT)
    return cv2.erode(inside, np.ones((2 * inset_px + 1,) * 2, np.uint8)) > 0


def plan_droplets(
    mappings: Sequence[ViewMapping],
    grid: VoxelGrid,
    names: Sequence[str] | None = None,
    *,
    margin_voxel: int = MARGIN_VOXEL,
) -> DropletSearch:
    """Plan the measurement of droplets in a grid from views of any mapping.

    Parameters
    ----------
    mappings : sequence of ViewMapping
        Two to eight views.
    grid : VoxelGrid
        Where droplets are to be measured, about one voxel per pixel.
    names : sequence of str, optional
        Of the views; by default their numbers, from 1.
    margin_voxel : int
        How far around the grid droplets are looked for; it must hold all that all views see.

    Raises
    ------
    ReconstructionError
        Too few or too many views, images that are too small, voxels much wider or narrower than pixels, or a mapping
        that is too rough to be sampled.
    """
    _require_fine(mappings, grid)
    searched = _widened(grid, margin_voxel)
    lattice = sight_lattice(mappings, searched)
    plan = plan_reconstruction(mappings, _coarser(searched), names=names)
    for name, mapping in zip(plan.names, mappings, strict=True):
        if min(mapping.image_size_px) < _native.MAX_BLOB_WINDOW_PX:
            width_px, height_px = mapping.image_size_px
            raise ReconstructionError(
                f"{name}: images of {width_px} x {height_px} px; droplets are measured in images of "
                f"{_native.MAX_BLOB_WINDOW_PX} px at least on each side"
            )
    return DropletSearch(grid, searched, lattice, plan, plan.names)


def _require_fine(mappings: Sequence[ViewMapping], grid: VoxelGrid) -> None:
    """Refuse voxels that are much wider or narrower than pixels, and say which are not."""
    middle_mm = grid.to_mm((np.array([grid.shape]) - 1) / 2)[0]
    px_per_mm = float(np.mean([scale_px_per_mm(mapping, middle_mm) for mapping in mappings]))
    if not LEAST_PX_PER_VOXEL <= (width_px := grid.pitch_mm * px_per_mm) <= MOST_PX_PER_VOXEL:
        least_mm, most_mm = LEAST_PX_PER_VOXEL / px_per_mm, MOST_PX_PER_VOXEL / px_per_mm
        raise RoughMapping(
            f"a voxel of {grid.pitch_mm:.4g} mm is {width_px:.3g} px wide: droplets are looked for with "
            f"{LEAST_PX_PER_VOXEL} to {MOST_PX_PER_VOXEL} px per voxel; leave the pitch out of the grid, or state one "
            f"from {least_mm:.2g} to {most_mm:.2g} mm"
        )


def _widened(grid: VoxelGrid, margin_voxel: int) -> VoxelGrid:
    nz, ny, nx = (n + 2 * margin_voxel for n in grid.shape)
    x_mm, y_mm, z_mm = (origin_mm - margin_voxel * grid.pitch_mm for origin_mm in grid.origin_mm)
    return VoxelGrid((nz, ny, nx), (x_mm, y_mm, z_mm), grid.pitch_mm)


def _coarser(grid: VoxelGrid) -> VoxelGrid:
    nz, ny, nx = (int((n - 1) / CANDIDATE_PITCH_VOXEL) + 2 for n in grid.shape)
    return VoxelGrid((nz, ny, nx), grid.origin_mm, CANDIDATE_PITCH_VOXEL * grid.pitch_mm)
