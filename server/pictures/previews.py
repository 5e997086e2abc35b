"""Previews of volumes: at most 192 voxels along each axis, 8 bits, small enough to keep in memory and to draw.

A full volume has 600 million voxels; reading one to show a slice would cost seconds and gigabytes. So the task that
reconstructs a shot makes a preview of each volume while its slabs come: every preview voxel is the maximum of a block
of voxels, so that no droplet disappears. A small volume is its own preview.
"""

import json
import math
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from daq.files.atomic_file import own_part_path
from daq.files.storage import storing
from processing.kernels import DEFAULT_THREADS, _native
from processing.reconstruction.slab_volume import Slabs, slabs_of
from processing.volume import VoxelGrid

LONGEST_AXIS = 192
AXES = "zyx"
_ENDING = ".preview.npz"


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

    @property
    def full_grid(self) -> VoxelGrid:
        """Where the voxels of the volume itself lie."""
        factor = math.ceil(max(self.full_shape) / max(self.voxels.shape))
        pitch_mm = self.grid.pitch_mm / factor
        x_mm, y_mm, z_mm = (origin_mm - 0.5 * (factor - 1) * pitch_mm for origin_mm in self.grid.origin_mm)
        return VoxelGrid(self.full_shape, (x_mm, y_mm, z_mm), pitch_mm)

    @property
    def fullest_mm(self) -> tuple[float, float, float]:
        """Where there is something to be seen, x, y, z: of each axis the plane of the largest sum."""
        others = {"x": (0, 1), "y": (0, 2), "z": (1, 2)}
        planes = {axis: int(self.voxels.sum(axis=over, dtype=np.int64).argmax()) for axis, over in others.items()}
        grid = self.grid
        return float(grid.x_mm[planes["x"]]), float(grid.y_mm[planes["y"]]), float(grid.z_mm[planes["z"]])

    @property
    def telling_level(self) -> float:
        """Level of an iso-surface that shows something: brighter voxels have half of all the intensity."""
        sums = np.bincount(self.voxels.ravel(), minlength=256) * np.arange(256)
        brighter = np.cumsum(sums[::-1])[::-1]
        level = int(np.count_nonzero(2 * brighter >= brighter[0])) - 1
        return float(np.clip(level, 1, 254)) / 256

    def projection(self, axis: str) -> NDArray[np.uint8]:
        """Maximum along an axis."""
        return np.asarray(self.voxels.max(axis=AXES.index(axis)), np.uint8)


class GrowingPreview:
    """The preview of a volume of non-negative values, slab after slab.

    Parameters
    ----------
    grid : VoxelGrid
        Of the volume.
    unit : float
        Intensity of a voxel of 1.
    longest_axis : int
        Most voxels of the preview along an axis.
    """

    def __init__(self, grid: VoxelGrid, unit: float = 1.0, longest_axis: int = LONGEST_AXIS) -> None:
        self._grid, self._unit = grid, unit
        self._factor = math.ceil(max(grid.shape) / longest_axis)
        self._shape = tuple(math.ceil(n / self._factor) for n in grid.shape)
        self._maxima: NDArray[Any] | None = None

    def add(self, first_row: int, slab: NDArray[Any]) -> None:
        """Take in the rows y from ``first_row`` on."""
        if self._maxima is None:
            self._maxima = np.zeros(self._shape, slab.dtype)
        _native.add_block_maxima(slab, first_row, self._factor, self._maxima, DEFAULT_THREADS)

    def watching(self, slabs: Slabs) -> Slabs:
        """The same slabs, taken in as they pass."""
        for first_row, slab in slabs:
            self.add(first_row, slab)
            yield first_row, slab

    def preview(self) -> VolumePreview:
        """What has been taken in."""
        reduced = np.zeros(self._shape, np.float32) if self._maxima is None else _singles(self._maxima)
        if self._unit != 1:
            reduced *= np.float32(self._unit)
        limit = float(reduced.max())
        reduced *= np.float32(255.0 / limit if limit > 0 else 0.0)
        voxels = np.rint(reduced, out=reduced).astype(np.uint8)
        return VolumePreview(voxels, _coarser(self._grid, self._factor, voxels.shape), limit, self._grid.shape)


def preview_of_slabs(slabs: Slabs, grid: VoxelGrid, unit: float = 1.0, longest: int = LONGEST_AXIS) -> VolumePreview:
    """Reduce the slabs of a volume to block maxima."""
    growing = GrowingPreview(grid, unit, longest)
    for first_row, slab in slabs:
        growing.add(first_row, slab)
    return growing.preview()


def make_preview(volume: NDArray[Any], grid: VoxelGrid, longest_axis: int = LONGEST_AXIS) -> VolumePreview:
    """Reduce a volume (z, y, x) of non-negative values to block maxima."""
    return preview_of_slabs(slabs_of(volume), grid, longest=longest_axis)


def preview_path(volume_file: Path) -> Path:
    """Where the preview of a volume lies."""
    return volume_file.with_suffix(_ENDING)


def volume_of(preview_file: Path) -> Path:
    """Where the volume of a preview lies, if it is kept."""
    return preview_file.with_name(preview_file.name.removesuffix(_ENDING) + ".vtkhdf")


def preview_files(folder: Path) -> list[Path]:
    """Previews in a folder."""
    return sorted(folder.glob(f"*{_ENDING}"))


def save_preview(path: Path, preview: VolumePreview, provenance: Mapping[str, Any] | None = None) -> None:
    """Write a preview and what its volume is made of; it replaces an older one at once, and has its volume's time."""
    arrays = {
        "voxels": preview.voxels,
        "origin_mm": preview.grid.origin_mm,
        "pitch_mm": preview.grid.pitch_mm,
        "limit": preview.limit,
        "full_shape": preview.full_shape,
        "provenance": json.dumps(dict(provenance or {})),
    }
    part = own_part_path(path)
    try:
        with storing(path.parent), zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
            for name, values in arrays.items():  # numpy's own takes level 6, far slower
                with file.open(f"{name}.npy", "w") as entry:
                    np.lib.format.write_array(entry, np.asanyarray(values), allow_pickle=False)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    if (volume := volume_of(path)).is_file():
        os.utime(part, ns=(volume.stat().st_mtime_ns,) * 2)
    part.replace(path)


def is_preview_of(path: Path, volume: Path) -> bool:
    """Whether a preview was made of a volume as it is now: it has its time, as a copy of an older volume has not."""
    return path.is_file() and path.stat().st_mtime_ns == volume.stat().st_mtime_ns


def load_provenance(path: Path) -> dict[str, Any]:
    """What the volume of a preview is made of; empty where the preview does not say."""
    with np.load(path, allow_pickle=False) as stored:
        told: dict[str, Any] = json.loads(str(stored["provenance"])) if "provenance" in stored else {}
    return told


def load_preview(path: Path) -> VolumePreview:
    """Read a preview."""
    with np.load(path, allow_pickle=False) as stored:
        voxels = stored["voxels"]
        nz, ny, nx = voxels.shape
        x_mm, y_mm, z_mm = stored["origin_mm"].tolist()
        full_z, full_y, full_x = stored["full_shape"].tolist()
        grid = VoxelGrid((nz, ny, nx), (x_mm, y_mm, z_mm), float(stored["pitch_mm"]))
        return VolumePreview(voxels, grid, float(stored["limit"]), (full_z, full_y, full_x))


def _singles(values: NDArray[Any]) -> NDArray[np.float32]:
    """OpenCV makes float32 of float16 seven times faster than numpy does."""
    if values.dtype != np.float16:
        return values.astype(np.float32)
    flat = values.view(np.int16).reshape(len(values), -1)
    return np.asarray(cv2.convertFp16(flat), np.float32).reshape(values.shape)


def _coarser(grid: VoxelGrid, factor: int, shape: tuple[int, ...]) -> VoxelGrid:
    """Grid of blocks: the first block's centre lies half a block from the volume's first voxel."""
    nz, ny, nx = shape
    shift_mm = 0.5 * (factor - 1) * grid.pitch_mm
    x_mm, y_mm, z_mm = grid.origin_mm
    return VoxelGrid((nz, ny, nx), (x_mm + shift_mm, y_mm + shift_mm, z_mm + shift_mm), grid.pitch_mm * factor)
