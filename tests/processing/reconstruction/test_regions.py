"""A region of interest, or a single slice, is the same part of the volume, wherever it lies."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from processing.geometry import ViewMapping
from processing.kernels import _native
from processing.reconstruction.choices import Accuracy, ReconstructionMethod
from processing.reconstruction.line_of_sight import line_of_sight
from processing.reconstruction.planning.node_view import FRAME_BEFORE_PX, NodeView, sample_mapping
from processing.reconstruction.planning.plan import MAX_DEVIATION_PX, Plan, plan_reconstruction
from processing.reconstruction.planning.rectified_view import MAP_SPACING_PX, RectifiedView
from processing.volume import VoxelGrid
from tests.support import oracle
from tests.support.sight_bounds import assert_equals_textbook, sample_error
from tests.support.sight_cases import PITCH_MM, Images, instruction_set

METHODS = [ReconstructionMethod.GAVLOS, ReconstructionMethod.MINLOS, ReconstructionMethod.MLOS]
WHOLE = VoxelGrid.centred((21, 67, 200), PITCH_MM)
MAPPINGS = oracle.cameras(3, roll_deg=4.0)
SINGLE_PX = 2e-4
"""What nodes in single precision, and the interpolation of both plans, may do to positions up to 330 px."""
Planned = Callable[[VoxelGrid], Plan]


@dataclass(frozen=True)
class Region:
    """A part of WHOLE, by first voxel and size (z, y, x)."""

    first: tuple[int, int, int]
    shape: tuple[int, int, int]

    @property
    def grid(self) -> VoxelGrid:
        x_mm, y_mm, z_mm = WHOLE.to_mm(np.array(self.first, dtype=float))
        return VoxelGrid(self.shape, (x_mm, y_mm, z_mm), PITCH_MM)

    @property
    def voxels(self) -> tuple[slice, ...]:
        return tuple(slice(at, at + n) for at, n in zip(self.first, self.shape, strict=True))


REGIONS = (
    Region((0, 0, 0), (5, 17, 33)),
    Region((13, 47, 161), (8, 20, 39)),
    Region((3, 30, 5), (1, 37, 190)),
    Region((20, 11, 17), (1, 1, 150)),
    Region((2, 66, 100), (19, 1, 64)),
    Region((1, 3, 199), (20, 60, 1)),
    Region((10, 33, 77), (1, 1, 1)),
)


def sampled(grid: VoxelGrid) -> Plan:
    return Plan(grid, tuple(sample_mapping(mapping, grid, MAX_DEVIATION_PX) for mapping in MAPPINGS))


def nominal(grid: VoxelGrid) -> Plan:
    return plan_reconstruction(MAPPINGS, grid)


def fine(grid: VoxelGrid) -> Plan:
    return plan_reconstruction(MAPPINGS, grid, Accuracy.FINE)


def images() -> Images:
    rng = np.random.default_rng(12)
    return [rng.uniform(0.1, 1, mapping.image_size_px[::-1]).astype(np.float32) for mapping in MAPPINGS]


def recorded_px(view: RectifiedView | NodeView, grid: VoxelGrid) -> NDArray[np.float64]:
    """Where a plan sees every voxel in the recorded image, (nz, ny, nx, 2)."""
    u, v = oracle.planned_positions(view, grid)
    if isinstance(view, NodeView):
        return np.stack([u, v], axis=-1) - FRAME_BEFORE_PX
    channels = np.moveaxis(view.nodes_px.astype(np.float64), -1, 0)
    return np.stack([oracle.bilinear(at, u / MAP_SPACING_PX, v / MAP_SPACING_PX) for at in channels], axis=-1)


@pytest.mark.parametrize("planned", [sampled, nominal, fine])
@pytest.mark.parametrize("region", REGIONS, ids=str)
def test_it_is_seen_where_the_whole_volume_is_seen(region: Region, planned: Planned) -> None:
    whole, part = planned(WHOLE), planned(region.grid)
    for in_whole, in_part, mapping in zip(whole.views, part.views, MAPPINGS, strict=True):
        distance_px = recorded_px(in_part, part.grid) - recorded_px(in_whole, WHOLE)[region.voxels]
        assert np.linalg.norm(distance_px, axis=-1).max() < in_whole.deviation_px + in_part.deviation_px + SINGLE_PX
        assert_inside(recorded_px(in_part, part.grid), mapping)


def assert_inside(image_px: NDArray[np.float64], mapping: ViewMapping) -> None:
    assert image_px.min() > 0
    assert (image_px < np.array(mapping.image_size_px) - 1).all()


@pytest.mark.parametrize("isa", _native.available_isas())
@pytest.mark.parametrize("planned", [sampled, nominal, fine])
@pytest.mark.parametrize("region", REGIONS, ids=str)
def test_it_equals_the_textbook(isa: str, region: Region, planned: Planned) -> None:
    plan = planned(region.grid)
    with instruction_set(isa):
        for method in METHODS:
            volume = line_of_sight(plan, images(), method)
            assert_equals_textbook(volume, plan, images(), method)


@pytest.mark.parametrize("isa", _native.available_isas())
@pytest.mark.parametrize("region", REGIONS, ids=str)
def test_by_nodes_it_is_the_same_part_of_the_volume(isa: str, region: Region) -> None:
    """The pixels are the same. Positions differ by both deviations; no pixel differs from the next by more than 1."""
    whole, part = sampled(WHOLE), sampled(region.grid)
    with instruction_set(isa):
        expected, volume = (line_of_sight(plan, images(), ReconstructionMethod.MINLOS) for plan in (whole, part))
    bounds = [
        np.sqrt(2) * (a.deviation_px + b.deviation_px) + 2 * sample_error(a, image)
        for a, b, image in zip(whole.views, part.views, whole.resample(images()), strict=True)
    ]
    np.testing.assert_allclose(volume, expected[region.voxels], rtol=0, atol=max(bounds))
