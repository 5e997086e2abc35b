"""The mean of exposures: that of their volumes."""

import numpy as np
import pytest
from numpy.typing import NDArray

from processing.kernels import _native
from processing.reconstruction import mean_line_of_sight as module
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.line_of_sight import line_of_sight
from processing.reconstruction.mean_line_of_sight import mean_line_of_sight, mean_volume
from processing.reconstruction.planning.node_view import sample_mapping
from processing.reconstruction.planning.plan import Plan, plan_reconstruction
from processing.reconstruction.slab_volume import SLAB_ROWS
from processing.reconstruction.volume_part import Part
from processing.volume import VoxelGrid
from tests.support import oracle

GRID = VoxelGrid.centred((11, 21, 75), 1 / 60)


def exposures(count: int) -> list[list[NDArray[np.float32]]]:
    rng = np.random.default_rng(2)
    sizes = [mapping.image_size_px[::-1] for mapping in oracle.cameras(3)]
    return [[(rng.random(size) * (rng.random(size) > 0.9)).astype(np.float32) for size in sizes] for _ in range(count)]


@pytest.mark.parametrize("isa", _native.available_isas())
@pytest.mark.parametrize("by_nodes", [False, True])
@pytest.mark.parametrize("method", list(ReconstructionMethod)[:3])
def test_it_is_the_mean_of_the_volumes(
    monkeypatch: pytest.MonkeyPatch, isa: str, by_nodes: bool, method: ReconstructionMethod
) -> None:
    monkeypatch.setenv("TOMOSHADOW_ISA", isa)
    mappings, shots = oracle.cameras(3), exposures(17)
    plan = plan_reconstruction(mappings, GRID)
    if by_nodes:
        plan = Plan(GRID, tuple(sample_mapping(mapping, GRID, 0.02) for mapping in mappings))
    monkeypatch.setattr(module, "BATCH_BYTES", 6 * plan.resampled_bytes)
    expected = np.mean([line_of_sight(plan, images, method) for images in shots], axis=0, dtype=np.float64)
    out = np.full(GRID.shape, 9, np.float32)
    assert mean_line_of_sight(plan, iter(shots), method, out) is out
    np.testing.assert_allclose(out, expected, rtol=1e-5, atol=1e-7)


TALL = VoxelGrid.centred((7, 2 * SLAB_ROWS + 9, 40), 1 / 60)


@pytest.mark.parametrize("fitting", [3, 5, 8])
def test_slabs_are_those_of_the_whole_mean_as_often_as_they_are_made(
    monkeypatch: pytest.MonkeyPatch, fitting: int
) -> None:
    plan, shots = plan_reconstruction(oracle.cameras(3), TALL), exposures(5)
    monkeypatch.setattr(module, "BATCH_EXPOSURES", fitting)
    whole = mean_line_of_sight(plan, shots)
    assert whole.any()
    mean = mean_volume(plan, iter(shots), ReconstructionMethod.MLOS)
    for _ in range(2):
        found = np.full(TALL.shape, np.nan, np.float32)
        for first_row, slab in mean.slabs():
            found[:, first_row : first_row + slab.shape[1]] = slab
        np.testing.assert_array_equal(found, whole)
    for part in (
        Part.plane(TALL, 0, 5),
        Part.plane(TALL, 1, 77),
        Part.plane(TALL, 2, 33),
        Part(range(2, 4), range(60, 130), range(9, 38)),
    ):
        np.testing.assert_array_equal(mean.part(part), whole[np.ix_(part.z, part.y, part.x)])


def test_what_has_no_mean_is_refused() -> None:
    plan = plan_reconstruction(oracle.cameras(3), GRID)
    with pytest.raises(ValueError, match="a mean needs one exposure or more"):
        mean_volume(plan, [], ReconstructionMethod.MLOS)
    with pytest.raises(ValueError, match="a mean needs one exposure or more"):
        mean_line_of_sight(plan, [])
    other = plan_reconstruction(oracle.cameras(3), GRID)
    views = [each.bind(each.resample(exposures(1)[0])) for each in (plan, other)]
    with pytest.raises(ValueError, match="exposures must be of the same views"):
        _native.sum_of_sight(views, "mlos", np.zeros(GRID.shape, np.float32), 1)
    with pytest.raises(ValueError, match="smart is not a line-of-sight method"):
        mean_line_of_sight(plan, exposures(1), ReconstructionMethod.SMART)
