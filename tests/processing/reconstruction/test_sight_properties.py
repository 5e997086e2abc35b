"""Line of sight equals the textbook for any geometry, on every instruction set, in every form of output."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from processing.kernels import _native
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.line_of_sight import line_of_sight, slabs_of_sight
from processing.reconstruction.mean_line_of_sight import mean_line_of_sight
from processing.reconstruction.planning.node_view import sample_mapping
from processing.reconstruction.planning.plan import MAX_DEVIATION_PX, Plan, plan_reconstruction
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
@given(case=cases(), method=st.sampled_from(METHODS), rows=st.integers(1, 50))
def test_slabs_and_means_are_the_same_volume(
    isa: str, case: tuple[Plan, Images], method: ReconstructionMethod, rows: int
) -> None:
    plan, images = case
    with instruction_set(isa):
        volume = line_of_sight(plan, images, method, np.empty(plan.grid.shape, np.float16))
        out = np.empty((plan.grid.shape[0], rows, plan.grid.shape[2]), np.float16)
        used = [np.full(view.shape_px, 99, np.int16) for view in plan.views]
        streamed = slabs_of_sight(plan, images, method, out=out, resampled=used)
        slabs = np.concatenate([slab.copy() for _, slab in streamed], axis=1)
        mean = mean_line_of_sight(plan, [images, images, images], method)
    np.testing.assert_array_equal(slabs, volume)
    np.testing.assert_allclose(mean, volume, rtol=2e-3, atol=1e-7)


def test_slabs_refuse_what_does_not_fit() -> None:
    grid, mappings = VoxelGrid.centred((3, 4, 5), PITCH_MM), oracle.cameras(2)
    plan, images = plan_reconstruction(mappings, grid), [np.ones(m.image_size_px[::-1], np.float32) for m in mappings]
    for shape in ((3, 0, 5), (3, 4, 6)):
        with pytest.raises(ValueError, match=r"slabs of shape \(3, .*\), they need \(3, one or more, 5\)"):
            next(slabs_of_sight(plan, images, out=np.empty(shape, np.float16)))
    with pytest.raises(ValueError, match="smart is not a line-of-sight method"):
        next(slabs_of_sight(plan, images, ReconstructionMethod.SMART))
    views = plan.bind(plan.resample(images))
    with pytest.raises(ValueError, match="more rows than the grid"):
        _native.line_of_sight(views, "mlos", np.zeros((3, 3, 5), np.float32), 1, 2, 4)
    with pytest.raises(ValueError, match="smart is not a line-of-sight method, see METHODS"):
        _native.line_of_sight(views, "smart", np.zeros(grid.shape, np.float32), 1)
