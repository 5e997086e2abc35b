"""Plans: the fast way where it is exact, the general way elsewhere, and no way into memory that is not there."""

import re
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from processing.geometry import FloatArray, PinholeCamera, ViewMapping, view_camera
from processing.kernels import _native
from processing.reconstruction.errors import ReconstructionError
from processing.reconstruction.line_of_sight import line_of_sight
from processing.reconstruction.planning.node_view import NodeView, sample_mapping
from processing.reconstruction.planning.plan import MAX_DEVIATION_PX, Plan, plan_reconstruction, plan_view
from processing.reconstruction.planning.planned_view import PlannedView
from processing.reconstruction.planning.rectified_view import MAP_SPACING_PX, RESAMPLING_PX, RectifiedView, rectify
from processing.reconstruction.smart import smart
from processing.volume import VoxelGrid
from tests.support import oracle
from tests.support.sight_cases import Bent

GRID = VoxelGrid.centred((40, 50, 60), 1 / 60)


def camera(azimuth_deg: float = 30.0, **options: object) -> PinholeCamera:
    return view_camera(azimuth_deg, focal_length_mm=85, magnification=0.43, scale_px_per_mm=60, **options)  # type: ignore[arg-type]


@settings(max_examples=20)
@given(
    azimuth_deg=st.floats(-60, 60),
    pitch_deg=st.floats(-20, 20),
    roll_deg=st.floats(-180, 180),
    offset_px=st.tuples(st.floats(-300, 300), st.floats(-300, 300)),
    tilt_rad=st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1)),
    k1=st.floats(-2, 2),
    pixels_per_voxel=st.sampled_from([0.95, 1.5]),
)
def test_any_pinhole_camera_is_rectified_exactly(
    azimuth_deg: float,
    pitch_deg: float,
    roll_deg: float,
    offset_px: tuple[float, float],
    tilt_rad: tuple[float, float],
    k1: float,
    pixels_per_voxel: float,
) -> None:
    mapping = replace(
        camera(
            azimuth_deg,
            pitch_deg=pitch_deg,
            roll_deg=roll_deg,
            principal_offset_px=offset_px,
            distortion=np.array([k1, 0, 0.002, -0.003, 0]),
        ),
        tilt_rad=tilt_rad,
    )
    view = rectify(mapping, GRID, pixels_per_voxel, MAX_DEVIATION_PX / 5)
    u, v = oracle.planned_positions(view, GRID)
    channels = np.moveaxis(view.nodes_px, -1, 0)
    seen_u, seen_v = (oracle.bilinear(channel, u / MAP_SPACING_PX, v / MAP_SPACING_PX) for channel in channels)
    expected_u, expected_v = oracle.seen_by(mapping, GRID)
    # the map itself is curved: bilinear interpolation of it is good to this
    np.testing.assert_allclose(seen_u, expected_u, atol=5e-3)
    np.testing.assert_allclose(seen_v, expected_v, atol=5e-3)


def test_lines_of_sight_that_do_not_meet_take_the_nodes() -> None:
    assert isinstance(plan_view(Bent(camera(), 0.0), GRID), RectifiedView)
    assert isinstance(plan_view(Bent(camera(), 0.05), GRID), RectifiedView)
    view = plan_view(Bent(camera(), 1.0), GRID)
    assert isinstance(view, NodeView)
    assert view.deviation_px <= MAX_DEVIATION_PX
    assert view.reason == "its lines of sight do not meet in one point"
    wavy = plan_view(Bent(camera(), wavelength_mm=3.0), GRID)
    assert isinstance(wavy, NodeView)
    assert re.fullmatch(r"rectified it would be off by 0\.\d+ px, limit 0\.02 px|its lines .*", wavy.reason)


@dataclass(frozen=True)
class Renamed:
    """A camera that knows no point where its lines of sight meet, or names a wrong one."""

    camera: PinholeCamera

    @property
    def image_size_px(self) -> tuple[int, int]:
        return self.camera.image_size_px

    @property
    def centre_mm(self) -> FloatArray:
        return np.zeros(3)

    def project(self, points_mm: FloatArray) -> FloatArray:
        return self.camera.project(points_mm)


@dataclass(frozen=True)
class Telecentric:
    """Lines of sight along one direction, 45 degrees from z."""

    image_size_px: tuple[int, int] = (320, 240)
    scale_px_per_mm: float = 60.0

    def project(self, points_mm: FloatArray) -> FloatArray:
        x_mm, y_mm, z_mm = points_mm.T
        return self.scale_px_per_mm * np.column_stack([(x_mm - z_mm) / np.sqrt(2), y_mm]) + (160, 120)


def test_a_view_is_central_by_what_it_does_not_by_what_it_is_called() -> None:
    view, same = plan_view(camera(), GRID), plan_view(Renamed(camera()), GRID)
    assert isinstance(same, RectifiedView)
    assert isinstance(view, RectifiedView)
    np.testing.assert_array_equal(same.nodes_px, view.nodes_px)
    assert same.foot == view.foot


def test_a_voxel_is_as_large_to_a_telecentric_view_from_wherever_it_looks() -> None:
    view = plan_view(Telecentric(), GRID)
    assert isinstance(view, NodeView)
    np.testing.assert_allclose(view.nodes[2], (60 * GRID.pitch_mm) ** 2, rtol=1e-4)


@pytest.mark.parametrize(
    ("mapping", "grid", "reason"),
    [
        (Telecentric(), GRID, "its lines of sight|rectified it would be off"),
        (camera(90.0), GRID, "meet beside the volume"),
        (camera(0.0), VoxelGrid.centred((9, 9, 9), 4 / 60), r"a voxel is 4 px wide, limit 1\.5 px"),
        (camera(0.0), VoxelGrid.centred((9001, 9, 9), 1.2 / 60), r"seen at 0\.\d\d of the scale .* limit 0\.63"),
    ],
)
def test_a_view_says_why_it_takes_the_nodes(mapping: ViewMapping, grid: VoxelGrid, reason: str) -> None:
    view = plan_view(mapping, grid)
    assert isinstance(view, NodeView)
    assert re.search(reason, view.reason)
    described = PlannedView.of(view)
    assert (described.mapping, described.node_spacing_voxel, described.reason) == ("exact", view.spacing, view.reason)
    assert described.deviation_px == pytest.approx(view.deviation_px, abs=1e-4)


@settings(max_examples=20)
@given(roll_deg=st.floats(-180, 180), bend=st.floats(-2, 2), wavelength_mm=st.floats(1.5, 9), saddle=st.floats(-4, 4))
def test_nodes_are_as_dense_as_it_takes(roll_deg: float, bend: float, wavelength_mm: float, saddle: float) -> None:
    mapping = Bent(camera(roll_deg=roll_deg), bend, wavelength_mm, saddle)
    view = sample_mapping(mapping, GRID, MAX_DEVIATION_PX)
    u, v, _ = np.moveaxis(oracle.node_values(view, GRID), -1, 0)
    expected_u, expected_v = oracle.seen_by(mapping, GRID)
    # waves are not quite of second order between nodes, and nodes are in single precision
    largest = np.hypot(u - 1 - expected_u, v - 1 - expected_v).max()
    assert largest < 1.1 * view.deviation_px + 1e-4
    assert view.deviation_px <= MAX_DEVIATION_PX


@pytest.mark.parametrize("saddle", [1.0, -4.0, 10.0])
def test_saddles_are_not_taken_for_straight(saddle: float) -> None:
    """In the middle between their nodes they are."""
    mapping = Bent(camera(), saddle_px_per_mm2=saddle)
    for max_deviation_px in (9.0, MAX_DEVIATION_PX):
        view = sample_mapping(mapping, GRID, max_deviation_px)
        u, v, _ = np.moveaxis(oracle.node_values(view, GRID), -1, 0)
        expected_u, expected_v = oracle.seen_by(mapping, GRID)
        largest = np.hypot(u - 1 - expected_u, v - 1 - expected_v).max()
        assert largest == pytest.approx(view.deviation_px, rel=0.05)


def test_a_rough_mapping_is_refused() -> None:
    with pytest.raises(ReconstructionError, match=r"not smooth: it bends by .* px within 2 voxels, limit 0.02 px"):
        sample_mapping(Bent(camera(), 0, wavelength_mm=0.05), GRID, MAX_DEVIATION_PX)
    views: list[ViewMapping] = [camera(), Bent(camera(), 0, wavelength_mm=0.05)]
    with pytest.raises(ReconstructionError, match=r"^view 2: mapping is not smooth.*does the grid reach beyond"):
        plan_reconstruction(views, GRID)
    with pytest.raises(ReconstructionError, match=r"^right: mapping is not smooth"):
        plan_reconstruction(views, GRID, names=["left", "right"])


def test_the_node_area_is_that_of_a_voxel() -> None:
    view = sample_mapping(camera(60.0), GRID, MAX_DEVIATION_PX)
    assert view.binning == 1
    np.testing.assert_allclose(view.nodes[2], 1, rtol=0.02)


def test_a_camera_beside_the_volume_takes_the_nodes() -> None:
    assert isinstance(plan_view(camera(90.0), GRID), NodeView)


def test_a_view_finer_than_the_voxels_takes_the_nodes_which_average_it() -> None:
    assert isinstance(plan_view(camera(), VoxelGrid.centred((9, 9, 9), 1.2 / 60)), RectifiedView)
    view = plan_view(camera(0.0), VoxelGrid.centred((9, 9, 9), 4 / 60))
    assert isinstance(view, NodeView)
    assert view.binning == 4


def test_a_single_plane_is_a_volume_too() -> None:
    assert isinstance(plan_view(camera(), VoxelGrid((1, 20, 30), (0, 0, 0.5), 1 / 60)), RectifiedView)


def test_two_to_eight_views() -> None:
    plan = plan_reconstruction(oracle.cameras(8), GRID)
    assert len(plan.views) == 8
    assert RESAMPLING_PX == 0.016
    assert RESAMPLING_PX < plan.deviation_px <= MAX_DEVIATION_PX + RESAMPLING_PX
    for count in (1, 9):
        with pytest.raises(ReconstructionError, match=f"{count} views, a reconstruction takes 2 to 8"):
            plan_reconstruction((oracle.cameras(8) * 2)[:count], GRID)


def rectified(pixels: NDArray[np.int16], scale: FloatArray, shift_u: FloatArray, shift_v: FloatArray) -> _native.View:
    return _native.View.rectified(pixels, 1.0, scale, shift_u, shift_v, (0.0, 0.0, 1000.0))


def test_kernels_refuse_geometry_that_leads_outside() -> None:
    volume, pixels = np.zeros((3, 4, 5), np.float32), np.zeros((20, 90), np.int16)
    scale, shift = np.ones(3), np.full(3, 2.0)
    inside = rectified(pixels, scale, shift, shift)
    _native.line_of_sight([inside], "mlos", volume, 1)
    nodes = np.zeros((3, 2, 2, 2), np.float32)
    _native.line_of_sight([_native.View.mapped(pixels, 1.0, nodes, 16)], "mlos", volume, 1)
    outside = [
        rectified(pixels, scale, shift + 30, shift),
        rectified(pixels, scale, shift, shift + 30),
        rectified(pixels, scale, shift, -shift),
        rectified(pixels, scale * 9, shift, shift),
        rectified(pixels, scale[:2], shift[:2], shift[:2]),
        rectified(pixels, scale, shift, np.full(3, np.nan)),
        _native.View.mapped(pixels, 1.0, nodes, 2),
    ]
    for view in outside:
        with pytest.raises(ValueError, match=r"(view|nodes): "):
            _native.line_of_sight([view], "mlos", volume, 1)
    blocks, projections = _native.Blocks.of_volume(volume, 1.0, 1), _native.Projections([inside], volume.shape)
    narrow = np.zeros((19, 90), np.int16)
    with pytest.raises(ValueError, match="projections and images differ in shape"):
        projections.correct(0, 1.0, narrow, 1.0, 0.25, 4096, np.zeros_like(pixels), 1)
    with pytest.raises(ValueError, match="no such view"):
        projections.correct(1, 1.0, pixels, 1.0, 0.25, 4096, np.zeros_like(pixels), 1)
    with pytest.raises(ValueError, match="of another shape than the blocks"):
        projections.smart_pass(_native.Blocks.of_volume(volume[1:], 1.0, 1), [False], [True], 1)
    with pytest.raises(ValueError, match="two flags per view"):
        projections.smart_pass(blocks, [False], [True, True], 1)
    with pytest.raises(ValueError, match="another shape than the blocks"):
        blocks.write(np.zeros((3, 4, 6), np.float32), 1)
    first = volume[:, :1].copy()
    for first_row, message in ((-8, "more rows"), (volume.shape[1], "more rows"), (1, "multiple of 8")):
        with pytest.raises(ValueError, match=message):
            blocks.write(first, 1, first_row)


def test_resampling_refuses_what_does_not_fit() -> None:
    image, nodes = np.zeros((9, 9), np.float32), np.zeros((2, 3, 2), np.float32)
    _native.resample(image, nodes, np.zeros((16, 32), np.int16), 1)
    for shape in ((17, 32), (16, 48)):
        with pytest.raises(ValueError, match="nodes do not cover"):
            _native.resample(image, nodes, np.zeros(shape, np.int16), 1)
    with pytest.raises(ValueError, match="multiple of 16 columns"):
        _native.resample(image, nodes, np.zeros((16, 31), np.int16), 1)
    with pytest.raises(ValueError, match="do not fill the output"):
        _native.quantise(image, 1, 2, np.zeros((12, 13), np.int16), 1)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, -1e-6])
@pytest.mark.parametrize("at", [(0, 0), (-1, -1), (100, 120)], ids=str)
@pytest.mark.parametrize("pitch", [1, 4])
@pytest.mark.parametrize("by_nodes", [False, True])
def test_pixels_that_are_no_intensities_are_refused_wherever_they_are(
    by_nodes: bool, pitch: int, at: tuple[int, int], value: float
) -> None:
    mappings, grid = oracle.cameras(2), VoxelGrid.centred((9, 9, 9), pitch / 60)
    views = [sample_mapping(one, grid, MAX_DEVIATION_PX) if by_nodes else plan_view(one, grid) for one in mappings]
    plan, images = Plan(grid, tuple(views)), [np.ones(one.image_size_px[::-1], np.float32) for one in mappings]
    plan.resample([np.copysign(np.zeros_like(image), -1) for image in images])
    images[1][at] = value
    row, column = (n % size for n, size in zip(at, images[1].shape, strict=True))
    with pytest.raises(ValueError, match=rf"view 2: pixel \(column {column}, row {row}\) is {np.float32(value)};"):
        line_of_sight(plan, images)
    named = replace(plan, names=("left", "right"))
    with pytest.raises(ValueError, match="right: pixel"):
        smart(named, images)


def test_views_keep_their_arrays_alive() -> None:
    view = rectified(np.full((20, 90), 32767, np.int16), np.ones(3), np.full(3, 2.0), np.full(3, 2.0))
    churn = [np.zeros((20, 90), np.int16) for _ in range(50)]
    volume = np.zeros((3, 4, 5), np.float32)
    _native.line_of_sight([view], "mlos", volume, 1)
    np.testing.assert_array_equal(volume, 32767)
    assert len(churn) == 50
