"""Line of sight equals the textbook for any geometry, on every instruction set, in every form of output."""

from collections.abc import Sequence
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from processing.kernels import _native
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.line_of_sight import line_of_sight
from processing.reconstruction.mean_line_of_sight import mean_line_of_sight
from processing.reconstruction.planning.node_view import sample_mapping
from processing.reconstruction.planning.plan import MAX_DEVIATION_PX, Plan, plan_reconstruction
from processing.reconstruction.sparse_line_of_sight import slabs_of_sight, sparse_line_of_sight
from processing.volume import VoxelGrid
from tests.support import oracle
from tests.support.sight_bounds import assert_equals_textbook
from tests.support.sight_cases import PITCH_MM, Images, cases, instruction_set

METHODS = [ReconstructionMethod.GAVLOS, ReconstructionMethod.MINLOS, ReconstructionMethod.MLOS]


@pytest.mark.parametrize("isa", _native.available_isas())
@settings(max_examples=40)
@given(case=cases(), method=st.sampled_from(METHODS), dtype=st.sampled_from(["float32", "float16", "uint8"]))
def test_volumes_equal_the_textbook(
    isa: str, case: tuple[Plan, Images], method: ReconstructionMethod, dtype: str
) -> None:
    plan, images = case
    with instruction_set(isa):
        volume = line_of_sight(plan, images, method, np.empty(plan.grid.shape, dtype))
        assert_equals_textbook(volume, plan, images, method)


@pytest.mark.parametrize("isa", _native.available_isas())
@pytest.mark.parametrize("by_nodes", [0, 1, 8])
@pytest.mark.parametrize("count", range(2, 9))
def test_any_number_of_views_in_any_format(isa: str, count: int, by_nodes: int) -> None:
    grid, mappings = VoxelGrid.centred((3, 17, 40), PITCH_MM), oracle.cameras(count, roll_deg=2.0)
    sampled = tuple(sample_mapping(mapping, grid, MAX_DEVIATION_PX) for mapping in mappings[:by_nodes])
    plan = Plan(grid, sampled + plan_reconstruction(mappings, grid).views[by_nodes:])
    rng = np.random.default_rng(count)
    images = [rng.uniform(0.2, 1, mapping.image_size_px[::-1]).astype(np.float32) for mapping in mappings]
    with instruction_set(isa):
        for method, dtype in product(METHODS, ("float32", "float16", "uint8")):
            volume = line_of_sight(plan, images, method, np.empty(grid.shape, dtype))
            assert_equals_textbook(volume, plan, images, method)


@pytest.mark.parametrize("isa", _native.available_isas())
@settings(max_examples=15)
@given(case=cases(), method=st.sampled_from(METHODS), floor=st.sampled_from([0.0, 0.3]), rows=st.integers(1, 50))
def test_bricks_slabs_and_means_are_the_same_volume(
    isa: str, case: tuple[Plan, Images], method: ReconstructionMethod, floor: float, rows: int
) -> None:
    plan, images = case
    with instruction_set(isa):
        volume = line_of_sight(plan, images, method, np.empty(plan.grid.shape, np.float16))
        bricks = sparse_line_of_sight(plan, images, method, floor=floor)
        out = np.empty((plan.grid.shape[0], rows, plan.grid.shape[2]), np.float16)
        used = [np.full(view.shape_px, 99, np.int16) for view in plan.views]
        streamed = slabs_of_sight(plan, images, method, out=out, resampled=used)
        slabs = np.concatenate([slab.copy() for _, slab in streamed], axis=1)
        mean = mean_line_of_sight(plan, [images, images, images], method)
    dense = bricks.dense()
    np.testing.assert_array_equal(dense[dense != 0], volume[dense != 0])
    assert (volume[dense == 0] <= floor).all()
    np.testing.assert_array_equal(slabs, volume)
    np.testing.assert_allclose(mean, volume, rtol=2e-3, atol=1e-7)


def empty_but(image: NDArray[np.float32], box: Sequence[slice]) -> NDArray[np.float32]:
    kept = np.zeros_like(image)
    kept[tuple(box)] = image[tuple(box)]
    return kept


def test_bricks_take_little_memory_and_come_in_any_format() -> None:
    grid = VoxelGrid.centred((21, 37, 275), PITCH_MM)
    mappings = oracle.cameras(3)
    plan = plan_reconstruction(mappings, grid)
    images = [
        empty_but(np.ones(m.image_size_px[::-1], np.float32), [slice(120, 150), slice(150, 180)]) for m in mappings
    ]
    bricks = sparse_line_of_sight(plan, images)
    assert 0 < bricks.occupancy < 0.3
    assert bricks.nbytes < 0.5 * 2 * np.prod(grid.shape)
    for dtype in ("float32", "float16", "uint8"):
        out = np.full(grid.shape, 9, dtype)
        assert bricks.dense(out) is out
        expected = line_of_sight(plan, images, out=np.empty(grid.shape, dtype))
        # bricks have float16, whose smallest step is 6e-8; a byte of them is rounded twice
        np.testing.assert_allclose(out.astype(float), expected, rtol=1e-3, atol=1 if dtype == "uint8" else 6e-8)
    with pytest.raises(ValueError, match=r"volume has shape \(2, 2, 2\), the bricks are of \(21, 37, 275\)"):
        bricks.dense(np.zeros((2, 2, 2), np.float16))


def test_streams_and_bricks_refuse_what_does_not_fit() -> None:
    grid, mappings = VoxelGrid.centred((3, 4, 5), PITCH_MM), oracle.cameras(2)
    plan, images = plan_reconstruction(mappings, grid), [np.ones(m.image_size_px[::-1], np.float32) for m in mappings]
    for shape in ((3, 0, 5), (3, 4, 6)):
        with pytest.raises(ValueError, match=r"slabs of shape \(3, .*\), they need \(3, one or more, 5\)"):
            next(slabs_of_sight(plan, images, out=np.empty(shape, np.float16)))
    for make in (sparse_line_of_sight, lambda *given: next(slabs_of_sight(*given))):
        with pytest.raises(ValueError, match="smart is not a line-of-sight method"):
            make(plan, images, ReconstructionMethod.SMART)
    views = plan.bind(plan.resample(images))
    with pytest.raises(ValueError, match="more rows than the grid"):
        _native.line_of_sight(views, 2, np.zeros((3, 3, 5), np.float32), 1, 2, 4)
