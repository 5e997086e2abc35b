"""Slices and regions are the same voxels of the whole volume, bit by bit."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from processing.kernels import _native
from processing.reconstruction.choices import Accuracy, ReconstructionMethod, VoxelType
from processing.reconstruction.planning.node_view import sample_mapping
from processing.reconstruction.planning.plan import MAX_DEVIATION_PX, Plan, plan_reconstruction
from processing.reconstruction.reconstructor import Reconstructor
from processing.reconstruction.seen_exposure import SeenExposure
from processing.reconstruction.settings import ReconstructionSettings
from processing.reconstruction.volume_part import Part
from processing.volume import VoxelGrid
from tests.support import oracle
from tests.support.sight_cases import PITCH_MM, Images, instruction_set

METHODS = [ReconstructionMethod.GAVLOS, ReconstructionMethod.MINLOS, ReconstructionMethod.MLOS]
SHAPES = [(21, 67, 200), (50, 35, 61), (1, 20, 40), (17, 1, 33)]


def rectified(shape: tuple[int, int, int]) -> Plan:
    return plan_reconstruction(oracle.cameras(4), VoxelGrid.centred(shape, PITCH_MM))


def fine(shape: tuple[int, int, int]) -> Plan:
    return plan_reconstruction(oracle.cameras(3), VoxelGrid.centred(shape, PITCH_MM), Accuracy.FINE)


def sampled(shape: tuple[int, int, int]) -> Plan:
    grid = VoxelGrid.centred(shape, PITCH_MM)
    return Plan(grid, tuple(sample_mapping(one, grid, MAX_DEVIATION_PX) for one in oracle.cameras(3, roll_deg=30.0)))


def mixed(shape: tuple[int, int, int]) -> Plan:
    first, second = rectified(shape), sampled(shape)
    return replace(first, views=(*first.views[:2], *second.views[2:]), names=())


PLANS = {plan.__name__: [plan(shape) for shape in SHAPES] for plan in (rectified, fine, sampled, mixed)}


def exposure(plan: Plan, seed: int) -> Images:
    """Dots on black, in patches: blocks of voxels are empty here and there."""
    rng = np.random.default_rng(seed)
    images = []
    for view in plan.views:
        rows, columns = view.image_size_px[::-1]
        patches = np.kron(rng.random((rows // 40 + 1, columns // 40 + 1)) < 0.6, np.ones((40, 40)))[:rows, :columns]
        images.append((patches * rng.random((rows, columns)) * 0.7).astype(np.float32))
    return images


def whole(plan: Plan, images: Images, method: ReconstructionMethod, voxels: VoxelType) -> NDArray[np.float32]:
    volume, _ = Reconstructor.of(plan, ReconstructionSettings(method=method, voxels=voxels)).reconstruct(images)
    return np.concatenate([slab.copy() for _, slab in volume.intensities()], axis=1)


def some_of(data: st.DataObject, n: int) -> range:
    first = data.draw(st.integers(0, n - 1))
    return range(first, data.draw(st.integers(first + 1, n)))


@settings(max_examples=60, deadline=None)
@given(
    st.sampled_from(sorted(PLANS)),
    st.integers(0, len(SHAPES) - 1),
    st.sampled_from(METHODS),
    st.sampled_from(VoxelType),
    st.sampled_from(_native.available_isas()),
    st.data(),
)
def test_any_part_is_that_of_the_whole_volume_bit_by_bit(
    kind: str, number: int, method: ReconstructionMethod, voxels: VoxelType, isa: str, data: st.DataObject
) -> None:
    plan = PLANS[kind][number]
    images = exposure(plan, number)
    part = Part(*(some_of(data, n) for n in plan.grid.shape))
    with instruction_set(isa):
        expected = whole(plan, images, method, voxels)
        seen = SeenExposure.of(plan, images).part(part, method, voxels, threads=data.draw(st.integers(1, 3)))
    assert expected.any()
    assert not expected.all()
    np.testing.assert_array_equal(seen, expected[np.ix_(part.z, part.y, part.x)])


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_its_voxels_lie_where_those_of_the_whole_grid_lie(axis: int) -> None:
    whole_grid = VoxelGrid((5, 6, 7), (-1.0, 2.0, 0.25), 0.1)
    ranges = [range(n) for n in whole_grid.shape]
    ranges[axis] = range(3, 4)
    grid = Part(*ranges).grid(whole_grid)
    assert grid.shape == tuple(map(len, ranges))
    name = "zyx"[axis]
    np.testing.assert_allclose(getattr(grid, f"{name}_mm"), getattr(whole_grid, f"{name}_mm")[3:4])
    assert [grid.origin_mm[2 - other] for other in range(3) if other != axis] == [
        whole_grid.origin_mm[2 - other] for other in range(3) if other != axis
    ]


def test_an_iterative_method_has_no_parts() -> None:
    plan = PLANS["rectified"][0]
    part = Part(range(1), range(1), range(1))
    with pytest.raises(ValueError, match="smart is not a line-of-sight method"):
        SeenExposure.of(plan, exposure(plan, 0)).part(part, ReconstructionMethod.SMART)
