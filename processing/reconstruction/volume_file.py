"""Volumes as VTKHDF ImageData, which ParaView opens (docs.vtk.org, VTKHDF file format 2.0).

Intensities are float32, or uint8 times an attribute. Those of float16 are stored as float32, which keeps their values
and deflates to little more: the VTKHDF format has no half precision, and where HDF5 converts it for VTK, that takes
half as long again. Chunks are parts of planes, deflated by ISA-L at its fastest: ordinary gzip for every reader,
several times faster to write.
"""

from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from daq.files.atomic_file import own_part_path, replacing
from daq.files.storage import storing
from processing.errors import BadInput
from processing.kernels import DEFAULT_THREADS
from processing.masked import require_unmasked
from processing.reconstruction.choices import VoxelType
from processing.reconstruction.slab_volume import SLAB_ROWS, SlabVolume
from processing.reconstruction.volume_seal import SEAL, seal_of
from processing.reconstruction.voxel_chunks import chunks_of
from processing.volume import VoxelGrid

FORMAT_VERSION = (2, 0)
INTENSITY = "intensity"
PROVENANCE = "tomoshadow"
SCHEMA = {"schema": "tomoshadow/volume", "schema_version": 1}
Value = str | int | float
Intensities = NDArray[np.float32]
_STORABLE = f"an array (z, y, x) of {' or '.join(VoxelType)}"
NO_PROVENANCE: Mapping[str, Value] = MappingProxyType({})


class VolumeFileError(BadInput):
    """A file does not hold a volume that can be read; the text names it."""


def write_volume(
    path: str | Path, volume: NDArray[Any], grid: VoxelGrid, provenance: Mapping[str, Value] = NO_PROVENANCE
) -> None:
    """Write a volume that is in memory as VTKHDF ImageData, which ParaView opens; whole, or not at all.

    Parameters
    ----------
    path : path
        Usually ``*.vtkhdf``; an existing file is replaced.
    volume : (z, y, x) float32, float16 or uint8 array
        Intensities; 255 is 1 where they are bytes.
    grid : VoxelGrid
        Where its voxels lie; VTK sees the same x, y, z in mm.
    provenance : Mapping[str, str | int | float]
        Where it comes from: kept as attributes of the group ``/tomoshadow``.

    Raises
    ------
    ValueError
        Volume and grid differ in shape, a voxel is infinite or not a number, or the volume is of another type.
    """
    _require_storable(path, volume)
    if volume.shape != grid.shape:
        raise ValueError(f"{path}: volume has shape {volume.shape}, its grid {grid.shape}")
    require_unmasked(str(path), volume)
    if not np.isfinite(volume).all():
        z, y, x = np.argwhere(~np.isfinite(volume))[0]
        raise ValueError(f"{path}: voxel (z {z}, y {y}, x {x}) is {volume[z, y, x]}")
    write_slabs(Path(path), SlabVolume.of(volume), grid, provenance)


def _require_storable(path: str | Path, volume: object) -> None:
    if not isinstance(volume, np.ndarray):
        raise ValueError(f"{path}: volume is a {type(volume).__name__}; {_STORABLE}, please")
    if volume.dtype.name not in list(VoxelType):
        raise ValueError(f"{path}: volume is of {volume.dtype}; {_STORABLE}, please")


def write_slabs(
    path: Path,
    volume: SlabVolume,
    grid: VoxelGrid,
    provenance: Mapping[str, Value],
    *,
    threads: int = DEFAULT_THREADS,
) -> None:
    """Write a volume as its slabs come; the file appears complete or not at all.

    Parameters
    ----------
    path : Path
        Usually ``*.vtkhdf``; an existing file is replaced.
    volume : SlabVolume
        Intensities.
    grid : VoxelGrid
        Where its voxels lie; VTK sees the same x, y, z in mm.
    provenance : Mapping[str, str | int | float]
        Where it comes from: kept as attributes of the group ``/tomoshadow``.
    threads : int
        Deflate side by side; what is read does not depend on it.

    Raises
    ------
    StorageError
        The disk is full, say; the text names it, and what to do.
    """
    with (
        storing(path.parent),
        replacing(path, own_part_path(path)) as part,
        h5py.File(part, "w", libver=("v110", "v110")) as file,
    ):
        dataset = _make_image_data(file.create_group("VTKHDF", track_order=True), volume, grid)
        _write_voxels(dataset, volume, threads)
        if volume.losses:
            dataset.attrs["lost_voxels"] = volume.losses.voxel_share
            dataset.attrs["lost_intensity"] = volume.losses.intensity_share
        file.create_group(PROVENANCE).attrs.update({**provenance, **SCHEMA})
        file[PROVENANCE].attrs[SEAL] = _seal_of(file)


@dataclass(frozen=True, eq=False)
class StoredVolume:
    """A volume in an open file, of which only what is asked for is read.

    Parameters
    ----------
    path : Path
        The file.
    grid : VoxelGrid
        Where its voxels lie.
    provenance : Mapping[str, str | int | float]
        Where it comes from.
    voxels : h5py.Dataset
        (nz, ny, nx), as stored.
    unit : float
        Intensity of a stored 1.
    """

    path: Path
    grid: VoxelGrid
    provenance: Mapping[str, Value]
    voxels: h5py.Dataset
    unit: float

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of voxels (nz, ny, nx)."""
        return self.grid.shape

    @property
    def lost_share(self) -> float:
        """Of the sum of all intensities, what was in voxels too faint for bytes; 0 where nobody counted."""
        return float(self.voxels.attrs.get("lost_intensity", 0.0))

    def __getitem__(self, part: slice | tuple[slice, slice]) -> Intensities:
        """Some planes z, or some rows y of them; float32 intensities.

        Raises
        ------
        VolumeFileError
            The file is damaged.
        """
        with _naming(self.path):
            values: Intensities = self.voxels[part].astype(np.float32, copy=False)
        if self.unit != 1:
            values *= np.float32(self.unit)
        return values

    def slabs(self) -> Iterator[tuple[int, Intensities]]:
        """First row and intensities of each slab."""
        for first_row in range(0, self.shape[1], SLAB_ROWS):
            yield first_row, self[:, first_row : first_row + SLAB_ROWS]


@contextmanager
def open_volume(path: Path) -> Iterator[StoredVolume]:
    """Open a volume that ``write_volume`` or ``write_slabs`` wrote.

    Raises
    ------
    VolumeFileError
        The file is missing, truncated, or not a volume.
    """
    with _naming(path):
        file = h5py.File(path, "r")
    with file:
        with _naming(path):
            stored = _stored(path, file)
        yield stored


def read_volume(path: str | Path) -> tuple[Intensities, VoxelGrid, dict[str, Value]]:
    """Read a volume of the product: ``tomoshadow reconstruct``, the server or ``write_volume`` wrote it.

    Parameters
    ----------
    path : path
        The file, ``*.vtkhdf``.

    Returns
    -------
    volume : (z, y, x) float32 array
        Intensities.
    grid : VoxelGrid
        Where its voxels lie.
    provenance : dict
        Where it comes from: run, shot, calibration, settings, versions.

    Raises
    ------
    VolumeFileError
        The file is missing, truncated, or not a volume.
    """
    with open_volume(Path(path)) as stored:
        return stored[:], stored.grid, dict(stored.provenance)


@contextmanager
def _naming(path: Path) -> Iterator[None]:
    try:
        yield
    except (OSError, KeyError, ValueError) as error:
        raise VolumeFileError(f"{path}: not a readable volume: {error}") from error


def _stored(path: Path, file: h5py.File) -> StoredVolume:
    voxels = file[f"VTKHDF/PointData/{INTENSITY}"]
    if file[PROVENANCE].attrs.get(SEAL, seal := _seal_of(file)) != seal:
        raise ValueError("its scale, place or origin was edited after it was written; copy it back, or make it again")
    written = {name: _plain(value) for name, value in file[PROVENANCE].attrs.items()}
    provenance = {name: value for name, value in written.items() if name not in {SEAL, *SCHEMA}}
    grid = _read_grid(file["VTKHDF"].attrs, voxels.shape)
    return StoredVolume(path, grid, provenance, voxels, float(voxels.attrs.get("scale_factor", 1.0)))


def _seal_of(file: h5py.File) -> str:
    voxels = file[f"VTKHDF/PointData/{INTENSITY}"]
    return seal_of(voxels.shape, file["VTKHDF"].attrs, voxels.attrs, file[PROVENANCE].attrs)


def _make_image_data(group: h5py.Group, volume: SlabVolume, grid: VoxelGrid) -> h5py.Dataset:
    nz, ny, nx = grid.shape
    group.attrs["Version"] = np.array(FORMAT_VERSION, dtype=np.int64)
    _write_name(group, "Type", "ImageData")
    group.attrs["WholeExtent"] = np.array([0, nx - 1, 0, ny - 1, 0, nz - 1], dtype=np.int64)
    group.attrs["Origin"] = np.array(grid.origin_mm, dtype=np.float64)
    group.attrs["Spacing"] = np.full(3, grid.pitch_mm, dtype=np.float64)
    group.attrs["Direction"] = np.eye(3, dtype=np.float64).ravel()
    dtype = np.uint8 if volume.voxels is VoxelType.UINT8 else np.float32
    dataset = group.create_group("PointData").create_dataset(
        INTENSITY,
        grid.shape,
        dtype,
        chunks=(1, min(SLAB_ROWS, ny), nx),
        compression="gzip",
        compression_opts=1,
    )
    _write_name(dataset, "Attribute", "Scalars")
    dataset.attrs.update({"units": "1", "axes": "z y x", "long_name": "inverted shadow intensity"})
    dataset.attrs.update({"voxels": volume.voxels.value, "scale_factor": volume.unit if dtype == np.uint8 else 1.0})
    return dataset


def _write_voxels(dataset: h5py.Dataset, volume: SlabVolume, threads: int) -> None:
    """Write chunks of whole size, as HDF5 wants them."""
    with ThreadPoolExecutor(threads) as pool:
        for first_row, slab in volume.slabs:
            for z, chunk in enumerate(chunks_of(slab, dataset.chunks[1:], dataset.dtype, volume.unit, pool)):
                dataset.id.write_direct_chunk((z, first_row, 0), chunk)


def _write_name(target: h5py.Group | h5py.Dataset, attribute: str, name: str) -> None:
    """A string of fixed length: VTK reads no others."""
    target.attrs.create(attribute, name.encode(), dtype=h5py.string_dtype("ascii", len(name)))


def _read_grid(attributes: Mapping[str, Any], shape: tuple[int, ...]) -> VoxelGrid:
    spacing_mm = [float(value) for value in attributes["Spacing"]]
    if len(set(spacing_mm)) != 1 or len(shape) != 3:
        raise ValueError(f"voxels are not cubes: shape {shape}, spacing {spacing_mm} mm")
    x_mm, y_mm, z_mm = (float(value) for value in attributes["Origin"])
    return VoxelGrid((shape[0], shape[1], shape[2]), (x_mm, y_mm, z_mm), spacing_mm[0])


def _plain(value: Any) -> Value:
    plain: Value = value.item() if isinstance(value, np.generic) else value
    return plain
