"""A list of dark voxels, and what hangs together: the same as scipy's labels of a volume."""

import numpy as np
import pytest
from scipy import ndimage

from processing.analysis.objects import dark_voxels as listing
from processing.analysis.objects.dark_voxels import connected, dark_voxels
from processing.volume import VoxelGrid

GRID = VoxelGrid((9, 14, 11), (0.0, 0.0, 0.0), 0.1)


def _volume(seed: int) -> np.ndarray[tuple[int, int, int], np.dtype[np.uint8]]:
    return np.random.default_rng(seed).integers(0, 256, GRID.shape, np.uint8)


@pytest.mark.parametrize("rows", [1, 5, 14])
def test_slabs_give_the_voxels_of_the_volume(rows: int) -> None:
    volume = _volume(1)
    slabs = [(first, volume[:, first : first + rows]) for first in range(0, GRID.shape[1], rows)]
    voxels = dark_voxels(slabs, GRID, 0.5)
    np.testing.assert_array_equal(voxels.numbers, np.flatnonzero(volume >= 0.5 * 255))
    np.testing.assert_array_equal(voxels.darkness, volume[volume >= 0.5 * 255])


@pytest.mark.parametrize("seed", range(4))
def test_objects_are_those_of_scipy(seed: int) -> None:
    volume = _volume(seed)
    voxels = dark_voxels([(0, volume)], GRID, 0.65)
    labels, count = ndimage.label(volume >= 0.65 * 255)
    objects = connected(voxels)
    pairs = set(zip(objects.tolist(), labels.ravel()[voxels.numbers].tolist(), strict=True))
    assert len(pairs) == count == objects.max() + 1


def test_more_dark_voxels_than_there_is_memory_for_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(listing, "MOST_VOXELS", 100)
    with pytest.raises(ValueError, match="more than 100 voxels are dark"):
        dark_voxels([(0, np.full(GRID.shape, 255, np.uint8))], GRID, 0.2)
