from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from processing.reconstruction.volume_file import open_volume, write_volume
from processing.volume import VoxelGrid
from server.pictures.previews import load_preview, make_preview, preview_of_slabs, save_preview

SHAPES = st.tuples(st.integers(1, 30), st.integers(1, 30), st.integers(1, 30))


@given(SHAPES, st.integers(1, 12), st.integers(0, 2**31))
def test_no_droplet_disappears_and_none_moves_by_more_than_a_block(
    shape: tuple[int, int, int], longest: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    voxel = tuple(int(rng.integers(size)) for size in shape)
    volume = np.zeros(shape, np.float32)
    volume[voxel] = 0.7
    grid = VoxelGrid.centred(shape, 0.5)
    preview = make_preview(volume, grid, longest)
    assert max(preview.voxels.shape) <= longest
    (found,) = np.argwhere(preview.voxels)
    true_mm, found_mm = grid.to_mm(np.array([voxel], float)), preview.grid.to_mm(found[None].astype(float))
    assert np.abs(true_mm - found_mm).max() <= 0.5 * preview.grid.pitch_mm
    assert preview.limit == pytest.approx(0.7)


def test_a_small_volume_is_its_own_preview(tmp_path: Path) -> None:
    volume = np.linspace(0, 2, 4 * 5 * 6, dtype=np.float32).reshape(4, 5, 6)
    grid = VoxelGrid((4, 5, 6), (1.0, 2.0, 3.0), 0.1)
    save_preview(tmp_path / "v.npz", make_preview(volume, grid))
    preview = load_preview(tmp_path / "v.npz")
    assert (preview.grid, preview.limit, preview.full_shape) == (grid, 2.0, (4, 5, 6))
    np.testing.assert_allclose(preview.voxels / 255 * 2, volume, atol=0.005)
    np.testing.assert_array_equal(preview.plane("y", 3), preview.voxels[:, 3])
    np.testing.assert_array_equal(preview.projection("x"), preview.voxels.max(axis=2))


def test_a_file_has_the_preview_of_its_volume(tmp_path: Path) -> None:
    volume = np.random.default_rng(2).random((9, 130, 11)).astype(np.float32)
    grid = VoxelGrid.centred(volume.shape, 0.1)
    write_volume(tmp_path / "v.vtkhdf", volume, grid, {})
    with open_volume(tmp_path / "v.vtkhdf") as stored:
        by_layers = preview_of_slabs(stored.slabs(), stored.grid, longest=30)
    whole = make_preview(volume, grid, 30)
    assert (by_layers.grid, by_layers.limit, by_layers.full_shape) == (whole.grid, whole.limit, whole.full_shape)
    np.testing.assert_array_equal(by_layers.voxels, whole.voxels)
    assert by_layers.voxels.max() == 255


def test_an_empty_volume_has_an_empty_preview() -> None:
    preview = make_preview(np.zeros((3, 3, 3), np.float32), VoxelGrid.centred((3, 3, 3), 1.0))
    assert preview.limit == 0
    assert not preview.voxels.any()


def test_a_plane_outside_is_refused_with_its_limit() -> None:
    preview = make_preview(np.ones((3, 4, 5), np.float32), VoxelGrid.centred((3, 4, 5), 1.0))
    with pytest.raises(IndexError, match="planes 0 to 3"):
        preview.plane("y", 4)


VOLUMES = st.tuples(SHAPES, st.integers(1, 12), st.integers(0, 2**31))


@given(VOLUMES)
def test_a_preview_knows_the_grid_of_its_volume(drawn: tuple[tuple[int, int, int], int, int]) -> None:
    shape, longest, _ = drawn
    grid = VoxelGrid(shape, (1.0, -2.0, 3.0), 0.25)
    again = make_preview(np.zeros(shape, np.float32), grid, longest).full_grid
    assert again.shape == shape
    np.testing.assert_allclose((*again.origin_mm, again.pitch_mm), (*grid.origin_mm, grid.pitch_mm))


@given(VOLUMES)
def test_where_one_looks_first_there_is_something(drawn: tuple[tuple[int, int, int], int, int]) -> None:
    shape, longest, seed = drawn
    rng = np.random.default_rng(seed)
    volume = np.zeros(shape, np.float32)
    voxel = tuple(int(rng.integers(size)) for size in shape)
    volume[voxel] = 0.01
    preview = make_preview(volume, VoxelGrid(shape, (0.0, 0.0, 0.0), 1.0), longest)
    index = np.rint(preview.grid.to_index(np.array([preview.fullest_mm]))[0]).astype(int)
    for axis, number in zip("zyx", index, strict=True):
        assert preview.plane(axis, int(number)).any()


@given(VOLUMES, st.floats(1e-6, 1e6))
def test_a_telling_level_shows_something_and_not_all_and_no_brightness_changes_it(
    drawn: tuple[tuple[int, int, int], int, int], scale: float
) -> None:
    shape, longest, seed = drawn
    volume = np.random.default_rng(seed).lognormal(size=shape).astype(np.float32)
    grid = VoxelGrid(shape, (0.0, 0.0, 0.0), 1.0)
    preview = make_preview(volume, grid, longest)
    assert 0 < preview.telling_level < 1
    brighter = preview.voxels[preview.voxels > 255 * preview.telling_level].sum(dtype=np.int64)
    assert 0.5 * preview.voxels.sum(dtype=np.int64) <= brighter
    scaled = make_preview(volume * np.float32(scale), grid, longest)
    assert abs(scaled.telling_level - preview.telling_level) <= 2 / 256


def test_faint_droplets_beside_a_bright_one_are_shown() -> None:
    volume = np.zeros((20, 20, 20), np.float32)
    volume[::4, ::4, ::4] = 0.12
    volume[10, 10, 10] = 1.0
    preview = make_preview(volume, VoxelGrid.centred((20, 20, 20), 1.0))
    assert np.count_nonzero(preview.voxels > 255 * preview.telling_level) == 126


def test_nothing_has_a_level_too() -> None:
    assert 0 < make_preview(np.zeros((2, 2, 2), np.float32), VoxelGrid.centred((2, 2, 2), 1.0)).telling_level < 1
