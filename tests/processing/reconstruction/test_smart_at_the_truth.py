"""SMART and MART stay where projections and images agree: nothing is taken from a volume that is right.

Images are what the textbook projects; the plan takes them as they are, without resampling.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from processing.reconstruction.planning.node_view import sample_mapping
from processing.reconstruction.planning.plan import Plan, plan_reconstruction
from processing.reconstruction.planning.rectified_view import MAP_SPACING_PX, RectifiedView
from processing.reconstruction.smart import mart, smart
from processing.volume import VoxelGrid
from tests.support import oracle

GRID = VoxelGrid.centred((17, 43, 96), 1 / 60)
FRAME = (slice(1, -2), slice(1, -2))
"""Of zeros, around the image of a view by nodes."""
Volume = NDArray[np.float32]


def as_it_is(view: RectifiedView) -> RectifiedView:
    """The same geometry, for an image that is rectified already."""
    rows, columns = view.shape_px
    v, u = np.indices(((rows - 1) // MAP_SPACING_PX + 2, columns // MAP_SPACING_PX + 1))
    nodes_px = MAP_SPACING_PX * np.stack([u, v], axis=-1).astype(np.float32)
    return replace(view, nodes_px=nodes_px, image_size_px=(columns, rows))


def plan_of(sampled: bool) -> Plan:
    mappings = oracle.cameras(4)
    if sampled:
        return Plan(GRID, tuple(sample_mapping(mapping, GRID, 0.02) for mapping in mappings))
    views = plan_reconstruction(mappings, GRID).views
    return Plan(GRID, tuple(as_it_is(view) for view in views if isinstance(view, RectifiedView)))


def single_voxels(count: int, seed: int = 4) -> Volume:
    """Droplets of one voxel each, of any brightness."""
    rng = np.random.default_rng(seed)
    truth = np.zeros(GRID.shape, np.float32)
    truth[tuple(rng.integers(2, np.array(GRID.shape)[:, None] - 2, (3, count)))] = rng.uniform(0.1, 1, count)
    return truth


def images_of(plan: Plan, truth: Volume) -> list[NDArray[np.float32]]:
    images = []
    for view in plan.views:
        image = oracle.project(view, truth.astype(np.float64), view.shape_px)
        images.append((image if isinstance(view, RectifiedView) else image[FRAME]).astype(np.float32))
    return images


@pytest.mark.parametrize("solve", [smart, mart])
@pytest.mark.parametrize("sampled", [False, True])
def test_the_truth_stays(isa: str, sampled: bool, solve: type(smart)) -> None:  # type: ignore[valid-type]
    plan, truth = plan_of(sampled), single_voxels(40)
    result = solve(plan, images_of(plan, truth), start=truth, iterations=20)
    np.testing.assert_allclose(result.volume[truth > 0], truth[truth > 0], rtol=1e-3)
    assert result.residuals[-1] < 1e-3


def test_what_no_view_has_seen_vanishes_and_the_rest_stays() -> None:
    plan, truth, others = plan_of(False), single_voxels(20), single_voxels(20, seed=5)
    others[truth > 0] = 0
    volume = smart(plan, images_of(plan, truth), start=truth + others, iterations=20).volume
    np.testing.assert_allclose(volume[truth > 0], truth[truth > 0], rtol=0.05)
    assert volume[others > 0].max() < 1e-3
