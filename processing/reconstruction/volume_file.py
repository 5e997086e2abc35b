"""Volumes as VTKHDF ImageData, which ParaView opens (docs.vtk.org, VTKHDF file format 2.0).

Intensities are stored as float32: VTK knows no half precision, whose values survive unchanged. Chunks are whole
planes, deflated by ISA-L at its fastest: ordinary gzip for every reader, several times faster to write.
"""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from isal import isal_zlib
from numpy.typing import NDArray

from processing.volume import VoxelGrid

FORMAT_VERSION = (2, 0)
INTENSITY = "intensity"
PROVENANCE = "tomoshadow"
SCHEMA = {"schema": "tomoshadow/volume", "schema_version": 1}
Value = str | int | float


class VolumeFileError(Exception):
    """A file does not hold a volume that can be read; the text names it."""


def write_volume(path: Path, volume: NDArray[Any], grid: VoxelGrid, provenance: Mapping[str, Value]) -> None:
    """Write a volume; the file appears complete or not at all.

    Parameters
    ----------
    path : Path
        Usually ``*.vtkhdf``; an existing file is replaced.
    volume : (z, y, x) float32 or float16 array
        Intensities.
    grid : VoxelGrid
        Where its voxels lie; VTK sees the same x, y, z in mm.
    provenance : Mapping[str, str | int | float]
        Where it comes from: kept as attributes of the group ``/tomoshadow``.

    Raises
    ------
    ValueError
        Volume and grid differ in shape.
    """
    if volume.shape != grid.shape:
        raise ValueError(f"{path}: volume has shape {volume.shape}, its grid {grid.shape}")
    part = path.with_name(path.name + ".part")
    try:
        with h5py.File(part, "w", libver=("v110", "v110")) as file:
            _write_image_data(file.create_group("VTKHDF", track_order=True), volume, grid)
            file.create_group(PROVENANCE).attrs.update({**provenance, **SCHEMA})
        _sync(part)
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def read_volume(path: Path) -> tuple[NDArray[np.float32], VoxelGrid, dict[str, Value]]:
    """Read a volume that ``write_volume`` wrote.

    Returns
    -------
    volume : (z, y, x) float32 array
    grid : VoxelGrid
    provenance : dict

    Raises
    ------
    VolumeFileError
        The file is missing, truncated, or not a volume.
    """
    try:
        with h5py.File(path, "r") as file:
            volume = file[f"VTKHDF/PointData/{INTENSITY}"][...].astype(np.float32, copy=False)
            grid = _read_grid(file["VTKHDF"].attrs, volume.shape)
            provenance = {name: _plain(value) for name, value in file[PROVENANCE].attrs.items()}
    except (OSError, KeyError, ValueError) as error:
        raise VolumeFileError(f"{path}: not a readable volume: {error}") from error
    return volume, grid, {name: value for name, value in provenance.items() if name not in SCHEMA}


def _write_image_data(group: h5py.Group, volume: NDArray[Any], grid: VoxelGrid) -> None:
    nz, ny, nx = grid.shape
    group.attrs["Version"] = np.array(FORMAT_VERSION, dtype=np.int64)
    _write_name(group, "Type", "ImageData")
    group.attrs["WholeExtent"] = np.array([0, nx - 1, 0, ny - 1, 0, nz - 1], dtype=np.int64)
    group.attrs["Origin"] = np.array(grid.origin_mm, dtype=np.float64)
    group.attrs["Spacing"] = np.full(3, grid.pitch_mm, dtype=np.float64)
    group.attrs["Direction"] = np.eye(3, dtype=np.float64).ravel()
    points = group.create_group("PointData")
    dataset = points.create_dataset(
        INTENSITY, grid.shape, np.float32, chunks=(1, ny, nx), shuffle=True, compression="gzip", compression_opts=1
    )
    _write_name(dataset, "Attribute", "Scalars")
    dataset.attrs.update({"units": "1", "axes": "z y x", "long_name": "inverted shadow intensity"})
    for z, plane in enumerate(volume):
        dataset.id.write_direct_chunk((z, 0, 0), _deflated(np.ascontiguousarray(plane, dtype=np.float32)))


def _write_name(target: h5py.Group | h5py.Dataset, attribute: str, name: str) -> None:
    """A string of fixed length: VTK reads no others."""
    target.attrs.create(attribute, name.encode(), dtype=h5py.string_dtype("ascii", len(name)))


def _deflated(plane: NDArray[np.float32]) -> bytes:
    """Shuffle and deflate, the bytes that HDF5's own filters would make."""
    bytes_by_significance = plane.reshape(-1, 1).view(np.uint8).T
    return isal_zlib.compress(np.ascontiguousarray(bytes_by_significance), 1)


def _read_grid(attributes: Mapping[str, Any], shape: tuple[int, ...]) -> VoxelGrid:
    spacing_mm = [float(value) for value in attributes["Spacing"]]
    if len(set(spacing_mm)) != 1 or len(shape) != 3:
        raise ValueError(f"voxels are not cubes: shape {shape}, spacing {spacing_mm} mm")
    x_mm, y_mm, z_mm = (float(value) for value in attributes["Origin"])
    return VoxelGrid((shape[0], shape[1], shape[2]), (x_mm, y_mm, z_mm), spacing_mm[0])


def _plain(value: Any) -> Value:
    plain: Value = value.item() if isinstance(value, np.generic) else value
    return plain


def _sync(path: Path) -> None:
    with path.open("rb") as file:
        os.fsync(file.fileno())
