"""What Python gave the kernels, and what they gave Python, stays valid as long as anybody uses it, and no longer."""

import gc
import weakref
from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from processing.kernels import _native
from processing.reconstruction.line_of_sight import line_of_sight
from processing.reconstruction.planning.plan import Plan, plan_reconstruction
from processing.reconstruction.sparse_volume import SparseVolume
from processing.volume import VoxelGrid
from tests.support import oracle
from tests.support.sight_cases import PITCH_MM, sampled_densely

GRID = VoxelGrid.centred((5, 21, 75), PITCH_MM)
PLANS = {
    "rectified": plan_reconstruction(oracle.cameras(2), GRID),
    "by nodes": Plan(GRID, tuple(sampled_densely(mapping, GRID, 8) for mapping in oracle.cameras(2))),
}


@pytest.fixture(params=PLANS)
def plan(request: pytest.FixtureRequest) -> Plan:
    return PLANS[request.param]


def images() -> list[NDArray[np.float32]]:
    rng = np.random.default_rng(6)
    return [rng.random(mapping.image_size_px[::-1]).astype(np.float32) for mapping in oracle.cameras(2)]


def churn() -> list[NDArray[np.uint8]]:
    """Collect what nobody uses, and write over the memory that this gave back."""
    gc.collect()
    return [np.full(size, 0xAA, np.uint8) for size in 4 * [1 << shift for shift in range(6, 21)]]


def unowned_views(plan: Plan) -> list[_native.View]:
    """Views of which only the kernels know the arrays."""
    resampled = plan.resample(images())
    return [deepcopy(view).bind(image, cull=True) for view, image in zip(plan.views, resampled, strict=True)]


def test_views_keep_pixels_and_geometry(plan: Plan) -> None:
    expected = line_of_sight(plan, images())
    views = unowned_views(plan)
    rubbish = churn()
    volume = np.empty(GRID.shape, np.float32)
    _native.line_of_sight(views, "mlos", volume, 2)
    np.testing.assert_array_equal(volume, expected)
    assert rubbish


def projected(projections: _native.Projections, blocks: _native.Blocks) -> tuple[float, float]:
    projections.smart_pass(blocks, [True, True], [True, True], 2)
    return projections.sum(0), projections.sum(1)


def test_projections_and_blocks_outlive_their_views(plan: Plan) -> None:
    bound = plan.bind(plan.resample(images()))
    expected = projected(
        _native.Projections(bound, GRID.shape), _native.Blocks.of_views(bound, GRID.shape, 1.0, 0.0, 1.0, 2)
    )
    views = unowned_views(plan)
    blocks = _native.Blocks.of_views(views, GRID.shape, 1.0, 0.0, 1.0, 2)
    projections = _native.Projections(views, GRID.shape)
    views.clear()
    rubbish = churn()
    assert projected(projections, blocks) == expected
    assert min(expected) > 0
    assert rubbish


def test_a_sparse_volume_outlives_what_it_came_from(plan: Plan) -> None:
    expected = SparseVolume.of_sight(plan, plan.resample(images())).dense()
    volume = SparseVolume.of_sight(plan, plan.resample(images()))
    rubbish = churn()
    np.testing.assert_array_equal(volume.dense(), expected)
    assert expected.any()
    assert rubbish


def test_nobody_keeps_an_image_longer_than_its_view(plan: Plan) -> None:
    resampled = plan.resample(images())
    pixels: list[Any] = [weakref.ref(image.pixels) for image in resampled]
    views = plan.bind(resampled)
    projections = _native.Projections(views, GRID.shape)
    del resampled, views
    gc.collect()
    assert all(kept() is not None for kept in pixels)
    del projections
    gc.collect()
    assert all(kept() is None for kept in pixels)
