"""Volume files: what is written comes back, ParaView's format is kept, broken files are named."""

from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOHDF import vtkHDFReader

from processing.reconstruction.choices import VoxelType
from processing.reconstruction.slab_volume import SLAB_ROWS, SlabVolume
from processing.reconstruction.volume_file import (
    VolumeFileError,
    open_volume,
    read_volume,
    write_slabs,
    write_volume,
)
from processing.reconstruction.voxel_chunks import PLANES_AT_ONCE
from processing.volume import VoxelGrid

GRID = VoxelGrid((5, 7, 11), (-1.0, 2.0, -3.5), 1 / 60)


TALL = VoxelGrid((3, 2 * SLAB_ROWS + 9, 5), (0.0, 0.0, 0.0), 0.1)


def some_volume(grid: VoxelGrid = GRID) -> NDArray[np.float32]:
    return np.random.default_rng(3).random(grid.shape).astype(np.float32)


@settings(max_examples=20)
@given(
    shape=st.tuples(st.integers(1, 6), st.integers(1, 6) | st.integers(60, 200), st.integers(1, 6)),
    origin_mm=st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.floats(-9, 9)),
    pitch_mm=st.floats(1e-3, 1),
    provenance=st.dictionaries(st.sampled_from(["run", "shot", "frame"]), st.text("abc -é") | st.integers(-9, 9)),
)
def test_everything_comes_back(
    tmp_path_factory: pytest.TempPathFactory,
    shape: tuple[int, int, int],
    origin_mm: tuple[float, float, float],
    pitch_mm: float,
    provenance: dict[str, str | int],
) -> None:
    path = tmp_path_factory.mktemp("volume") / "one.vtkhdf"
    volume = np.random.default_rng(1).normal(size=shape).astype(np.float32)
    grid = VoxelGrid(shape, origin_mm, pitch_mm)
    write_volume(path, volume, grid, provenance)
    read, its_grid, its_provenance = read_volume(path)
    np.testing.assert_array_equal(read, volume)
    assert its_grid == grid
    assert its_provenance == provenance


def test_half_precision_comes_back_as_float32(tmp_path: Path) -> None:
    half = some_volume().astype(np.float16)
    write_volume(tmp_path / "half.vtkhdf", half, GRID, {})
    volume, _, _ = read_volume(tmp_path / "half.vtkhdf")
    assert volume.dtype == np.float32
    np.testing.assert_array_equal(volume, half.astype(np.float32))


@pytest.mark.parametrize(
    ("dtype", "stored", "unit"), [("float32", "f4", 1), ("float16", "f4", 1), ("uint8", "u1", 1 / 255)]
)
def test_a_file_says_how_its_voxels_are_to_be_read(tmp_path: Path, dtype: str, stored: str, unit: float) -> None:
    volume = (some_volume(TALL) * (255 if dtype == "uint8" else 1)).astype(dtype)
    write_volume(tmp_path / "one.vtkhdf", volume, TALL, {})
    with h5py.File(tmp_path / "one.vtkhdf") as file:
        dataset = file["VTKHDF/PointData/intensity"]
        assert (dataset.dtype, dataset.attrs["voxels"], dataset.attrs["scale_factor"]) == (stored, dtype, unit)
        read, _, _ = read_volume(tmp_path / "one.vtkhdf")
        np.testing.assert_array_equal(read, dataset[...].astype(np.float32) * np.float32(unit))
    np.testing.assert_array_equal(read, volume.astype(np.float32) * np.float32(unit))


@pytest.mark.parametrize("voxels", VoxelType)
def test_slabs_may_come_in_the_same_memory_and_in_a_unit(tmp_path: Path, voxels: VoxelType) -> None:
    volume = (some_volume(TALL) * 200).astype("uint8" if voxels is VoxelType.UINT8 else "float16")
    memory = np.empty((3, SLAB_ROWS, 5), volume.dtype)

    def slabs() -> Iterator[tuple[int, NDArray[np.generic]]]:
        for first_row in range(0, TALL.shape[1], SLAB_ROWS):
            rows = volume[:, first_row : first_row + SLAB_ROWS]
            memory[:, : rows.shape[1]] = rows
            yield first_row, memory[:, : rows.shape[1]]

    write_slabs(tmp_path / "one.vtkhdf", SlabVolume(slabs(), voxels, 0.3), TALL, {})
    np.testing.assert_array_equal(read_volume(tmp_path / "one.vtkhdf")[0], volume.astype(np.float32) * np.float32(0.3))


def test_every_number_of_half_precision_is_stored_as_it_is(tmp_path: Path) -> None:
    grid = VoxelGrid((3, SLAB_ROWS + 1, 200), (0.0, 0.0, 0.0), 0.1)
    count = int(np.prod(grid.shape))
    half = (np.arange(count, dtype=np.uint16) % 0x7C00).view(np.float16).reshape(grid.shape)  # all that are finite
    assert np.unique(half).size == 0x7C00
    write_volume(tmp_path / "one.vtkhdf", half, grid, {})
    np.testing.assert_array_equal(read_volume(tmp_path / "one.vtkhdf")[0], half.astype(np.float32))


@pytest.mark.parametrize("voxels", VoxelType)
def test_a_file_holds_the_same_however_many_threads_deflate(tmp_path: Path, voxels: VoxelType) -> None:
    grid = VoxelGrid((2 * PLANES_AT_ONCE + 3, SLAB_ROWS + 9, 5), (0.0, 0.0, 0.0), 0.1)
    volume = (some_volume(grid) * 200).astype(voxels.value)
    for threads in (1, 3):
        write_slabs(tmp_path / f"{threads}.vtkhdf", SlabVolume.of(volume), grid, {}, threads=threads)
    one, three = (read_volume(tmp_path / f"{threads}.vtkhdf")[0] for threads in (1, 3))
    np.testing.assert_array_equal(one, three)


def test_parts_are_read_by_planes_and_by_slabs(tmp_path: Path) -> None:
    volume = some_volume(TALL)
    write_volume(tmp_path / "one.vtkhdf", volume, TALL, {"run": "r1"})
    with open_volume(tmp_path / "one.vtkhdf") as stored:
        assert (stored.shape, stored.grid, dict(stored.provenance)) == (TALL.shape, TALL, {"run": "r1"})
        np.testing.assert_array_equal(stored[1:2], volume[1:2])
        slabs = dict(stored.slabs())
        assert list(slabs) == [0, SLAB_ROWS, 2 * SLAB_ROWS]
        np.testing.assert_array_equal(np.concatenate(list(slabs.values()), axis=1), volume)


def test_a_volume_of_before_the_types_is_read(tmp_path: Path) -> None:
    write_volume(tmp_path / "old.vtkhdf", some_volume(), GRID, {})
    with h5py.File(tmp_path / "old.vtkhdf", "r+") as file:
        for name in ("voxels", "scale_factor"):
            del file["VTKHDF/PointData/intensity"].attrs[name]
        del file["tomoshadow"].attrs["seal_sha256"]
    np.testing.assert_array_equal(read_volume(tmp_path / "old.vtkhdf")[0], some_volume())


@pytest.mark.parametrize(
    ("group", "name", "value"),
    [
        ("VTKHDF/PointData/intensity", "scale_factor", 0.5),
        ("VTKHDF/PointData/intensity", "lost_intensity", 0.0),
        ("VTKHDF", "Origin", [0.0, 0.0, 0.0]),
        ("VTKHDF", "Spacing", [0.2, 0.2, 0.2]),
        ("tomoshadow", "shot", 7),
        ("tomoshadow", "settings", "{}"),
    ],
)
@pytest.mark.parametrize("dtype", ["float32", "uint8"])
def test_a_volume_whose_scale_place_or_origin_was_edited_is_refused(
    tmp_path: Path, dtype: str, group: str, name: str, value: object
) -> None:
    write_volume(tmp_path / "one.vtkhdf", (200 * some_volume()).astype(dtype), GRID, {"run": "r1", "shot": 3})
    with h5py.File(tmp_path / "one.vtkhdf", "r+") as file:
        file[group].attrs[name] = value
    with pytest.raises(VolumeFileError, match=r"one\.vtkhdf: .*its scale, place or origin was edited after"):
        read_volume(tmp_path / "one.vtkhdf")


def test_it_is_vtk_image_data(tmp_path: Path) -> None:
    write_volume(tmp_path / "one.vtkhdf", some_volume(), GRID, {"run": "r1"})
    with h5py.File(tmp_path / "one.vtkhdf") as file:
        attributes = file["VTKHDF"].attrs
        assert attributes["Type"] == b"ImageData"
        assert list(attributes["Version"]) == [2, 0]
        assert list(attributes["WholeExtent"]) == [0, 10, 0, 6, 0, 4]
        np.testing.assert_allclose(attributes["Origin"], [-1, 2, -3.5])
        np.testing.assert_allclose(attributes["Direction"], np.eye(3).ravel())
        assert file["VTKHDF/PointData/intensity"].shape == GRID.shape
        assert file["VTKHDF/PointData/intensity"].compression == "gzip"


@pytest.mark.parametrize("voxels", list(VoxelType))
def test_vtk_reads_a_volume(tmp_path: Path, voxels: VoxelType) -> None:
    reader = vtkHDFReader()
    volume = (some_volume(TALL) * 255 if voxels is VoxelType.UINT8 else some_volume(TALL)).astype(voxels.value)
    write_slabs(tmp_path / "one.vtkhdf", SlabVolume.of(volume), TALL, {})
    reader.SetFileName(str(tmp_path / "one.vtkhdf"))
    reader.Update()
    image = reader.GetOutput()
    assert (image.GetDimensions(), image.GetOrigin()) == (TALL.shape[::-1], TALL.origin_mm)
    assert image.GetSpacing() == (TALL.pitch_mm,) * 3
    seen = vtk_to_numpy(image.GetPointData().GetArray("intensity")).reshape(TALL.shape)
    np.testing.assert_array_equal(seen, volume)


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "one.vtkhdf"
    write_volume(path, some_volume(), GRID, {})
    with pytest.raises(TypeError):
        write_volume(path, some_volume() * 2, GRID, {"run": object()})  # type: ignore[dict-item]
    assert [file.name for file in tmp_path.iterdir()] == ["one.vtkhdf"]
    np.testing.assert_array_equal(read_volume(path)[0], some_volume())


def test_a_volume_of_another_shape_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"one\.vtkhdf: volume has shape \(2, 2, 2\)"):
        write_volume(tmp_path / "one.vtkhdf", np.zeros((2, 2, 2), np.float32), GRID, {})


@pytest.mark.parametrize("fraction", [0.0, 0.3, 0.7, 0.98])
def test_a_truncated_file_is_named(tmp_path: Path, fraction: float) -> None:
    path = tmp_path / "cut.vtkhdf"
    write_volume(path, some_volume(), GRID, {})
    path.write_bytes(path.read_bytes()[: int(fraction * path.stat().st_size)])
    with pytest.raises(VolumeFileError, match=r"cut\.vtkhdf: not a readable volume"):
        read_volume(path)


def test_files_without_a_volume_are_named(tmp_path: Path) -> None:
    with pytest.raises(VolumeFileError, match=r"absent\.vtkhdf"):
        read_volume(tmp_path / "absent.vtkhdf")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1
    with pytest.raises(VolumeFileError, match=r"other\.h5"):
        read_volume(tmp_path / "other.h5")


def test_a_flipped_bit_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "flipped.vtkhdf"
    write_volume(path, some_volume(), GRID, {})
    with h5py.File(path) as file:
        chunk = file["VTKHDF/PointData/intensity"].id.get_chunk_info(2)
    content = bytearray(path.read_bytes())
    content[chunk.byte_offset + chunk.size // 2] ^= 16
    path.write_bytes(content)
    with pytest.raises(VolumeFileError, match=r"flipped\.vtkhdf"):
        read_volume(path)
