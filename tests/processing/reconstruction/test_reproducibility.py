"""The same input gives the same bits, with any number of threads, on every instruction set."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from processing.reconstruction.choices import Accuracy, ReconstructionMethod
from processing.reconstruction.line_of_sight import line_of_sight, slabs_of_sight
from processing.reconstruction.mean_line_of_sight import mean_line_of_sight
from processing.reconstruction.planning.node_view import sample_mapping
from processing.reconstruction.planning.plan import MAX_DEVIATION_PX, Plan, plan_reconstruction
from processing.reconstruction.smart import mart, smart
from processing.reconstruction.sparse_volume import SparseVolume
from processing.volume import VoxelGrid
from tests.support import oracle
from tests.support.sight_cases import PITCH_MM, Images

METHODS = [ReconstructionMethod.GAVLOS, ReconstructionMethod.MINLOS, ReconstructionMethod.MLOS]
GRID = VoxelGrid.centred((9, 75, 101), PITCH_MM)
"""Five slabs of sixteen rows and ten of eight: threads of any number get unequal shares."""
MAPPINGS = oracle.cameras(3, roll_deg=3.0)
Arrays = Iterable[NDArray[Any]]


@pytest.fixture(params=[0, 1, 3], ids="{} by nodes".format)
def plan(request: pytest.FixtureRequest) -> Plan:
    """None, some or all views by nodes."""
    sampled = tuple(sample_mapping(mapping, GRID, MAX_DEVIATION_PX) for mapping in MAPPINGS[: request.param])
    return Plan(GRID, sampled + plan_reconstruction(MAPPINGS, GRID, Accuracy.FINE).views[request.param :])


@pytest.fixture
def images() -> Images:
    rng = np.random.default_rng(8)
    sizes = [mapping.image_size_px[::-1] for mapping in MAPPINGS]
    return [(rng.random(size) * (rng.random(size) > 0.6)).astype(np.float32) for size in sizes]


def assert_same_bits(compute: Callable[[int], Arrays]) -> None:
    expected = [array.copy() for array in compute(1)]
    assert any(array.any() for array in expected)
    for threads in (1, 2, 3):
        for array, first in zip(compute(threads), expected, strict=True):
            np.testing.assert_array_equal(array, first, strict=True)


@pytest.mark.parametrize("method", METHODS)
def test_volumes(isa: str, plan: Plan, images: Images, method: ReconstructionMethod) -> None:
    assert_same_bits(lambda threads: [line_of_sight(plan, images, method, threads=threads)])


@pytest.mark.parametrize("method", METHODS)
def test_slabs(isa: str, plan: Plan, images: Images, method: ReconstructionMethod) -> None:
    assert_same_bits(lambda threads: [slab for _, slab in slabs_of_sight(plan, images, method, threads=threads)])


def test_sparse_volumes(isa: str, plan: Plan, images: Images) -> None:
    def blocks(threads: int) -> Arrays:
        volume = SparseVolume.of_sight(plan, plan.resample(images), threads=threads)
        return np.array(volume.nbytes), volume.dense(threads=threads)

    assert_same_bits(blocks)


@pytest.mark.parametrize("method", METHODS)
def test_means(isa: str, plan: Plan, images: Images, method: ReconstructionMethod) -> None:
    exposures = [images, [image[::-1, ::-1] for image in images]]
    assert_same_bits(lambda threads: [mean_line_of_sight(plan, exposures, method, threads=threads)])


@pytest.mark.parametrize("solve", [smart, mart])
def test_smart_and_mart(isa: str, plan: Plan, images: Images, solve: type(smart)) -> None:  # type: ignore[valid-type]
    def refined(threads: int) -> Arrays:
        result = solve(plan, images, iterations=3, relaxation=0.7, threads=threads)
        return result.volume, np.array(result.residuals)

    assert_same_bits(refined)


def test_resampled_images(isa: str, plan: Plan, images: Images) -> None:
    assert_same_bits(lambda threads: [image.pixels for image in plan.resample(images, threads)])
