"""The sampled way: nodes of every spacing and mappings of every kind equal the textbook, on every instruction set."""

import numpy as np
import pytest

from processing.geometry import PinholeCamera, ViewMapping, view_camera
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.line_of_sight import line_of_sight
from processing.reconstruction.planning.node_view import NodeView, sample_mapping
from processing.reconstruction.planning.plan import MAX_DEVIATION_PX, Plan, plan_view
from processing.reconstruction.planning.rectified_view import RESAMPLING_PX, RectifiedView
from processing.volume import VoxelGrid
from tests.support import oracle
from tests.support.sight_bounds import assert_equals_textbook
from tests.support.sight_cases import PITCH_MM, Bent, Images, Kind, polynomial_of

METHODS = [ReconstructionMethod.GAVLOS, ReconstructionMethod.MINLOS, ReconstructionMethod.MLOS]
GRID = VoxelGrid.centred((11, 21, 75), PITCH_MM)
WAVELENGTH_MM = {16: 6.0, 8: 3.0, 4: 1.5, 2: 0.75}
"""By node spacing: a wave of one pixel bends by 0.35 px mm^2 (spacing / 16 / wavelength)^2 between nodes: 0.01 px."""


def cameras(count: int, roll_deg: float) -> list[PinholeCamera]:
    """Cameras whose images hold the whole grid, with a margin."""
    return [
        view_camera(
            azimuth_deg,
            focal_length_mm=85,
            magnification=0.43,
            scale_px_per_mm=60,
            image_size_px=(140 + number, 130 - number),
            pitch_deg=3.0 * (number % 3 - 1),
            roll_deg=roll_deg + 2 * number,
            distortion=np.array(oracle.DISTORTIONS[number % 3]),
        )
        for number, azimuth_deg in enumerate(oracle.AZIMUTHS_DEG[:count])
    ]


def noise(mappings: list[ViewMapping]) -> Images:
    rng = np.random.default_rng(4)
    return [rng.uniform(0.1, 1, mapping.image_size_px[::-1]).astype(np.float32) for mapping in mappings]


def sampled_plan(mappings: list[ViewMapping]) -> Plan:
    return Plan(GRID, tuple(sample_mapping(mapping, GRID, MAX_DEVIATION_PX) for mapping in mappings))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("roll_deg", [0.0, 40.0, 175.0])
@pytest.mark.parametrize("spacing", WAVELENGTH_MM)
def test_nodes_of_every_spacing(isa: str, spacing: int, roll_deg: float, method: ReconstructionMethod) -> None:
    mappings: list[ViewMapping] = [
        Bent(camera, wavelength_mm=WAVELENGTH_MM[spacing]) for camera in cameras(4, roll_deg)
    ]
    plan, images = sampled_plan(mappings), noise(mappings)
    assert {view.spacing for view in plan.views if isinstance(view, NodeView)} == {spacing}
    assert_all_inside(plan)
    assert_equals_textbook(line_of_sight(plan, images, method), plan, images, method)


def assert_all_inside(plan: Plan) -> None:
    """No position is limited by the edges, so that the kernels may read without asking."""
    for view in plan.views:
        u, v = oracle.planned_positions(view, plan.grid)
        assert min(u.min(), v.min()) > 3
        assert u.max() < view.shape_px[1] - 6
        assert v.max() < view.shape_px[0] - 6


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("roll_deg", [0.0, 100.0])
@pytest.mark.parametrize("kind", [Kind.TILTED, Kind.POLYNOMIAL])
def test_mappings_of_every_kind(isa: str, kind: Kind, roll_deg: float, method: ReconstructionMethod) -> None:
    mappings = [kind.of(camera) for camera in cameras(3, roll_deg)]
    plan, images = sampled_plan(mappings), noise(mappings)
    assert_equals_textbook(line_of_sight(plan, images, method), plan, images, method)


@pytest.mark.parametrize("kind", [Kind.TILTED, Kind.POLYNOMIAL])
def test_plans_of_every_kind_see_what_the_mapping_sees(kind: Kind) -> None:
    mappings = [kind.of(camera) for camera in cameras(3, 10.0)]
    for mapping, view in zip(mappings, sampled_plan(mappings).views, strict=True):
        u, v = oracle.planned_positions(view, GRID)
        expected_u, expected_v = oracle.seen_by(mapping, GRID)
        assert np.hypot(u - 1 - expected_u, v - 1 - expected_v).max() < 1.1 * view.deviation_px + 1e-4


@pytest.mark.parametrize("z_mm", [-0.7, -0.2, 0.0, 0.5])
@pytest.mark.parametrize("planes", [1, 2, 5])
def test_the_middle_of_a_polynomial_is_not_taken_for_a_camera(planes: int, z_mm: float) -> None:
    """It has a ``centre_mm`` too, in which no lines of sight meet; those of this one meet where its camera is."""
    camera = cameras(1, 5.0)[0]
    grid = VoxelGrid((planes, 21, 75), (-0.6, -0.15, z_mm), PITCH_MM)
    view, expected = plan_view(polynomial_of(camera), grid), plan_view(camera, grid)
    assert isinstance(view, RectifiedView)
    assert isinstance(expected, RectifiedView)
    assert view.deviation_px - RESAMPLING_PX <= MAX_DEVIATION_PX
    np.testing.assert_allclose(view.scale, expected.scale, rtol=1e-3)
    assert view.foot == pytest.approx(expected.foot, rel=0.02)


def test_positions_in_large_images_are_in_single_precision(isa: str) -> None:
    """Noise, in which pixels differ most from their neighbours, at the far edge of 2000 columns."""
    camera = view_camera(
        30.0, focal_length_mm=85, magnification=0.43, scale_px_per_mm=60, image_size_px=(2000, 150), roll_deg=2.0
    )
    grid = VoxelGrid((9, 24, 100), (16.5, -0.7, 0.0), PITCH_MM)
    view = sample_mapping(camera, grid, MAX_DEVIATION_PX)
    plan, images = Plan(grid, (view, view)), noise([camera, camera])[:1] * 2
    u, _ = oracle.planned_positions(view, grid)
    assert 1800 < u.min() < u.max() < 1999
    volume = line_of_sight(plan, images, ReconstructionMethod.MINLOS)
    assert_equals_textbook(volume, plan, images, ReconstructionMethod.MINLOS)
    expected = oracle.planned_line_of_sight(plan, images, ReconstructionMethod.MINLOS)
    np.testing.assert_allclose(volume, expected, rtol=0, atol=2e-4)
