"""How many views still see at a place: where too few do, nothing is known, whatever is there."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from processing.geometry import FloatArray, ViewMapping
from processing.preprocessing import Intensity
from processing.volume import VoxelGrid

BLACK_ABOVE = 0.9
"""A line of sight with less than a tenth of its light tells nothing of what else lies on it."""
PLACES_MM = 0.15
"""From place to place of a map."""
JUDGING = 3
"""So many views must see a droplet before it is believed."""
MOST_CELLS = 64
"""Of a map that is kept, along an axis."""


@dataclass(frozen=True, eq=False)
class UnseenMap:
    """Where too few views see, along z.

    Parameters
    ----------
    percent : (rows, columns) array
        Of each line along z, that fewer than three views see.
    x_mm, y_mm : (low, high)
        Ends of the map, from edge to edge.
    """

    percent: FloatArray
    x_mm: tuple[float, float]
    y_mm: tuple[float, float]

    @classmethod
    def of(cls, seeing: NDArray[np.uint8], grid: VoxelGrid, views: int = JUDGING) -> "UnseenMap":
        """Map of how many of the views see (z, y, x) at the places of a grid, coarser where these are many."""
        step = -(-max(grid.shape[1:]) // MOST_CELLS)
        percent = 100 * np.mean(seeing < min(JUDGING, views), axis=0)
        for axis in (0, 1):
            starts = np.arange(0, percent.shape[axis], step)
            sizes = np.diff(np.append(starts, percent.shape[axis]))
            percent = np.moveaxis(np.moveaxis(np.add.reduceat(percent, starts, axis), axis, -1) / sizes, -1, axis)
        half_mm = grid.pitch_mm / 2
        x_mm, y_mm = ((float(along[0]) - half_mm, float(along[-1]) + half_mm) for along in (grid.x_mm, grid.y_mm))
        return cls(np.asarray(percent, np.float64), x_mm, y_mm)

    def told(self) -> dict[str, Any]:
        """As files have it, in whole percent."""
        return {"percent": np.rint(self.percent).astype(int).tolist(), "x_mm": self.x_mm, "y_mm": self.y_mm}

    @classmethod
    def mean_of(cls, told: Sequence[Mapping[str, Any]]) -> "UnseenMap":
        """Mean of the maps of some files that are of the same places."""
        first = told[0]
        return cls(
            np.mean([one["percent"] for one in told], axis=0, dtype=np.float64),
            (first["x_mm"][0], first["x_mm"][1]),
            (first["y_mm"][0], first["y_mm"][1]),
        )


def map_grid(grid: VoxelGrid) -> VoxelGrid:
    """A grid of places all over another one."""
    step = max(1, round(PLACES_MM / grid.pitch_mm))
    pitch_mm = step * grid.pitch_mm
    counts = tuple(max(1, n // step) for n in grid.shape)
    starts = [0.5 * (n - 1 - (count - 1) * step) * grid.pitch_mm for n, count in zip(grid.shape, counts, strict=True)]
    x_mm, y_mm, z_mm = (origin + start for origin, start in zip(grid.origin_mm, starts[::-1], strict=True))
    return VoxelGrid((counts[0], counts[1], counts[2]), (x_mm, y_mm, z_mm), pitch_mm)


def places_of(grid: VoxelGrid) -> FloatArray:
    """All centres (N, 3) x, y, z of a grid, in the order of a flat volume."""
    z, y, x = np.meshgrid(grid.z_mm, grid.y_mm, grid.x_mm, indexing="ij")
    return np.column_stack([x.ravel(), y.ravel(), z.ravel()])


def pixels_of(mapping: ViewMapping, points_mm: FloatArray) -> NDArray[np.int32]:
    """Column and row (N, 2) of the pixel in which a view sees each point (N, 3); the nearest one beside the image."""
    seen_px = np.rint(mapping.project(points_mm))
    return np.clip(seen_px, 0, np.array(mapping.image_size_px) - 1).astype(np.int32)


def seeing_views(
    darkness: Sequence[Intensity], pixels: Sequence[NDArray[np.int32]], grid: VoxelGrid
) -> NDArray[np.uint8]:
    """How many views see light at each place of a grid (z, y, x).

    Parameters
    ----------
    darkness : sequence of (rows, columns) float32 arrays
        Share of the light that is missing; 1 where nothing is known.
    pixels : sequence of (N, 2) arrays
        Of ``pixels_of`` for each view.
    """
    seeing = [
        image[rows, columns] < BLACK_ABOVE
        for image, (columns, rows) in zip(darkness, (p.T for p in pixels), strict=True)
    ]
    return np.sum(seeing, axis=0, dtype=np.uint8).reshape(grid.shape)


def unknown_shares(seeing: NDArray[np.uint8], views: int) -> tuple[float, float]:
    """Share of the volume that no view sees, and that too few see for a droplet."""
    return float(np.mean(seeing == 0)), float(np.mean(seeing < min(JUDGING, views)))
