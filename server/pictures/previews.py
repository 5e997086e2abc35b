"""Previews of volumes: at most 192 voxels along each axis, 8 bits, small enough to keep in memory and to draw.

A full volume has 600 million voxels; reading one to show a slice would cost seconds and gigabytes. So the task that
reconstructs a shot leaves a preview beside each volume: every preview voxel is the maximum of a block of voxels, so
that no droplet disappears. A small volume is its own preview.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from processing.volume import VoxelGrid

LONGEST_AXIS = 192
AXES = "zyx"


@dataclass(frozen=True, eq=False)
class VolumePreview:
    """A volume in short.

    Parameters
    ----------
    voxels : (nz, ny, nx) uint8 array
        255 stands for ``limit``.
    grid : VoxelGrid
        Where the preview's voxels lie.
    limit : float
        Largest value of the volume.
    full_shape : tuple[int, int, int]
        Voxels of the volume itself.
    """

    voxels: NDArray[np.uint8]
    grid: VoxelGrid
    limit: float
    full_shape: tuple[int, int, int]

    def plane(self, axis: str, index: int) -> NDArray[np.uint8]:
        """Slice across an axis ``x``, ``y`` or ``z``.

        Raises
        ------
        IndexError
            The preview has no such plane; the text names the limit.
        """
        number = AXES.index(axis)
        if not 0 <= index < self.voxels.shape[number]:
            raise IndexError(f"{axis} = {index}: the preview has planes 0 to {self.voxels.shape[number] - 1}")
        return np.asarray(np.take(self.voxels, index, number), np.uint8)

    def projection(self, axis: str) -> NDArray[np.uint8]:
        """Maximum along an axis."""
        return np.asarray(self.voxels.max(axis=AXES.index(axis)), np.uint8)


class Planes(Protocol):
    """A volume (z, y, x) that gives away some planes: an array, or an open file."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of voxels (nz, ny, nx)."""

    def __getitem__(self, planes: slice, /) -> NDArray[Any]:
        """Planes z."""


def make_preview(volume: Planes, grid: VoxelGrid, longest_axis: int = LONGEST_AXIS) -> VolumePreview:
    """Reduce a volume (z, y, x) of non-negative values to block maxima; one layer of blocks in memory at a time."""
    factor = math.ceil(max(volume.shape) / longest_axis)
    starts = range(0, volume.shape[0], factor)
    reduced = np.concatenate([_block_maxima(volume[z : z + factor], factor) for z in starts]).astype(np.float32)
    limit = float(reduced.max())
    voxels = np.clip(np.rint(reduced * (255.0 / limit if limit > 0 else 0.0)), 0, 255).astype(np.uint8)
    return VolumePreview(voxels, _coarser(grid, factor, voxels.shape), limit, grid.shape)


def preview_path(volume_file: Path) -> Path:
    """Where the preview of a volume lies."""
    return volume_file.with_suffix(".preview.npz")


def save_preview(path: Path, preview: VolumePreview) -> None:
    """Write a preview; it replaces an older one at once."""
    part = path.with_suffix(".part")
    with part.open("wb") as file:
        np.savez_compressed(
            file,
            voxels=preview.voxels,
            origin_mm=preview.grid.origin_mm,
            pitch_mm=preview.grid.pitch_mm,
            limit=preview.limit,
            full_shape=preview.full_shape,
        )
    part.replace(path)


def load_preview(path: Path) -> VolumePreview:
    """Read a preview."""
    with np.load(path, allow_pickle=False) as stored:
        voxels = stored["voxels"]
        nz, ny, nx = voxels.shape
        x_mm, y_mm, z_mm = stored["origin_mm"].tolist()
        full_z, full_y, full_x = stored["full_shape"].tolist()
        grid = VoxelGrid((nz, ny, nx), (x_mm, y_mm, z_mm), float(stored["pitch_mm"]))
        return VolumePreview(voxels, grid, float(stored["limit"]), (full_z, full_y, full_x))


def _block_maxima(volume: NDArray[Any], factor: int) -> NDArray[Any]:
    """Maximum of blocks of factor^3 voxels; the last block of an axis may be smaller."""
    for axis in range(3):
        starts = np.arange(0, volume.shape[axis], factor)
        volume = np.maximum.reduceat(volume, starts, axis=axis) if factor > 1 else volume
    return volume


def _coarser(grid: VoxelGrid, factor: int, shape: tuple[int, ...]) -> VoxelGrid:
    """Grid of blocks: the first block's centre lies half a block from the volume's first voxel."""
    nz, ny, nx = shape
    shift_mm = 0.5 * (factor - 1) * grid.pitch_mm
    x_mm, y_mm, z_mm = grid.origin_mm
    return VoxelGrid((nz, ny, nx), (x_mm + shift_mm, y_mm + shift_mm, z_mm + shift_mm), grid.pitch_mm * factor)
