"""Sparse volumes: line of sight where it is not empty, in little memory, in any form of output."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from numpy.typing import NDArray

from processing.kernels import _native
from processing.reconstruction.choices import VoxelType
from processing.reconstruction.line_of_sight import line_of_sight
from processing.reconstruction.planning.plan import Plan, plan_reconstruction
from processing.reconstruction.sparse_volume import NEGLIGIBLE, SparseVolume
from processing.volume import VoxelGrid
from tests.support import oracle
from tests.support.sight_cases import PITCH_MM, Images, cases, instruction_set


@pytest.mark.parametrize("exponent", [1.0, 0.5])
@pytest.mark.parametrize("isa", _native.available_isas())
@settings(max_examples=15)
@given(case=cases())
def test_it_is_mlos_where_that_is_not_negligible(isa: str, exponent: float, case: tuple[Plan, Images]) -> None:
    plan, images = case
    with instruction_set(isa):
        dense = line_of_sight(plan, images)
        resampled = plan.resample(images)
        volume = SparseVolume.of_sight(plan, resampled, exponent).dense()
    most = float(np.prod([image.brightest for image in resampled])) ** exponent
    np.testing.assert_allclose(volume, dense**exponent, rtol=2**-11 + 1e-6, atol=NEGLIGIBLE * most)


def empty_but(image: NDArray[np.float32], box: Sequence[slice]) -> NDArray[np.float32]:
    kept = np.zeros_like(image)
    kept[tuple(box)] = image[tuple(box)]
    return kept


def test_it_takes_little_memory_and_comes_in_any_format() -> None:
    grid = VoxelGrid.centred((21, 37, 275), PITCH_MM)
    mappings = oracle.cameras(3)
    plan = plan_reconstruction(mappings, grid)
    images = [
        empty_but(np.ones(m.image_size_px[::-1], np.float32), [slice(120, 150), slice(150, 180)]) for m in mappings
    ]
    volume = SparseVolume.of_sight(plan, plan.resample(images))
    assert 0 < volume.nbytes < 0.3 * 2 * np.prod(grid.shape)
    for voxels in VoxelType:
        out = np.full(grid.shape, 9, voxels.value)
        assert volume.dense(out) is out
        expected = line_of_sight(plan, images, out=np.empty(grid.shape, voxels.value))
        # blocks are as fine as float16; a byte of them is rounded twice
        np.testing.assert_allclose(out.astype(float), expected, rtol=1e-3, atol=voxels is VoxelType.UINT8 or NEGLIGIBLE)
    with pytest.raises(ValueError, match="volume: another shape than the blocks"):
        volume.dense(np.zeros((2, 2, 2), np.float16))


def test_a_volume_comes_back_as_fine_as_float16() -> None:
    volume = np.random.default_rng(1).uniform(0, 7, (5, 21, 70)).astype(np.float32)
    volume[:, 8:16] = 0
    sparse = SparseVolume.of(volume)
    np.testing.assert_allclose(sparse.dense(), volume, rtol=2**-11)
    np.testing.assert_array_equal(SparseVolume.of(sparse.dense()).dense(), sparse.dense())


def test_it_lends_its_memory_and_says_so() -> None:
    volume = np.ones((5, 21, 70), np.float32)
    earlier = SparseVolume.of(volume)
    later = SparseVolume.of(2 * volume, memory=earlier)
    assert earlier.nbytes == 0
    with pytest.raises(ValueError, match="a later volume took their memory"):
        earlier.dense()
    np.testing.assert_array_equal(later.dense(), 2)
