"""Shapes from silhouettes: what the hull makes longer is told as long as it is, wherever and however it is seen."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from processing.analysis.objects.dark_voxels import connected
from processing.analysis.objects.liquid_objects import LiquidObjects, ObjectClass, liquid_objects
from processing.geometry import FloatArray
from processing.volume import VoxelGrid
from tests.support.seen_hulls import distant_views, hull_of

GRID = VoxelGrid.centred((41, 41, 41), 0.025)
Body = tuple[FloatArray, float]


def _seen(body: Body, sight: FloatArray | None = None, grid: VoxelGrid = GRID) -> LiquidObjects:
    sight = distant_views() if sight is None else sight
    voxels = hull_of(*body, sight, grid)
    return liquid_objects(voxels, connected(voxels), sight)


def _ball(radius_mm: float = 0.15) -> Body:
    return np.zeros((1, 3)), radius_mm


def _thread(direction: tuple[float, float, float], length_mm: float = 0.6, radius_mm: float = 0.04) -> Body:
    along = np.arange(-length_mm / 2, length_mm / 2, 0.5 * radius_mm)
    unit = np.array(direction) / np.linalg.norm(direction)
    return along[:, None] * unit, radius_mm


def _disc(normal: tuple[float, float, float], radius_mm: float = 0.25) -> Body:
    across = np.linalg.svd(np.array([normal]))[2][1:]
    steps = np.arange(-radius_mm, radius_mm + 0.01, 0.03)
    a, b = (values.ravel() for values in np.meshgrid(steps, steps))
    within = np.hypot(a, b) <= radius_mm
    return np.column_stack([a[within], b[within]]) @ across, 0.03


@given(
    st.floats(0.02, 0.3),
    st.tuples(*[st.floats(-0.1, 0.1)] * 3),
    st.sampled_from([0.02, 0.03]),
)
@settings(max_examples=8, deadline=None)
def test_a_ball_of_any_size_anywhere_is_a_droplet(
    radius_mm: float, place_mm: tuple[float, float, float], pitch_mm: float
) -> None:
    count = int(0.9 / pitch_mm)
    found = _seen((np.array([place_mm]), radius_mm), grid=VoxelGrid.centred((count,) * 3, pitch_mm))
    assert found.classes.tolist() in ([], [ObjectClass.DROPLET])


def test_the_hull_of_a_ball_is_longer_than_the_ball_is_told_to_be() -> None:
    voxels = hull_of(*_ball(), distant_views(), GRID)
    assert np.ptp(voxels.points_mm[:, 2]) > 1.3 * 0.3
    found = _seen(_ball())
    np.testing.assert_allclose([found.lengths_mm[0], found.thicknesses_mm[0]], 0.3, atol=0.04)


DIRECTIONS = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 0), (0.3, -0.8, 0.5)]


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_a_thread_in_any_direction_is_a_ligament_of_its_length(direction: tuple[float, float, float]) -> None:
    found = _seen(_thread(direction))
    assert found.classes.tolist() == [ObjectClass.LIGAMENT]
    np.testing.assert_allclose(found.lengths_mm, 0.66, atol=0.05)
    unit = np.array(direction) / np.linalg.norm(direction)
    assert abs(found.directions[0] @ unit) > 0.98


@pytest.mark.parametrize("normal", DIRECTIONS)
def test_a_disc_in_any_direction_is_a_sheet(normal: tuple[float, float, float]) -> None:
    found = _seen(_disc(normal))
    assert found.classes.tolist() == [ObjectClass.SHEET]
    assert abs(found.directions[0] @ (np.array(normal) / np.linalg.norm(normal))) > 0.95


BODIES: list[Callable[[], Body]] = [_ball, lambda: _thread((1, 0.4, 0.3)), lambda: _disc((0.2, 0.3, 1))]


@pytest.mark.parametrize("body", BODIES)
def test_neither_order_of_views_nor_place_nor_voxels_matter(body: Callable[[], Body]) -> None:
    one, other = _seen(body()), _seen(body(), distant_views()[[2, 0, 3, 1]])
    np.testing.assert_allclose(other.lengths_mm, one.lengths_mm)
    balls, radius_mm = body()
    moved = _seen((balls + 2.5, radius_mm), grid=VoxelGrid(GRID.shape, tuple(o + 2.5 for o in GRID.origin_mm), 0.025))  # type: ignore[arg-type]
    np.testing.assert_allclose(moved.points_mm - 2.5, one.points_mm, atol=0.005)
    np.testing.assert_allclose(moved.lengths_mm, one.lengths_mm, atol=0.01)
    finer = _seen(body(), grid=VoxelGrid.centred((61, 61, 61), 0.0165))
    assert finer.classes.tolist() == one.classes.tolist()
    np.testing.assert_allclose(finer.lengths_mm, one.lengths_mm, atol=3 * float(one.length_sd_mm[0]))


@pytest.mark.parametrize("body", BODIES)
def test_a_turn_about_y_with_the_views_turns_the_object(body: Callable[[], Body]) -> None:
    turn = np.deg2rad(25.0)
    rotation = np.array([[np.cos(turn), 0, -np.sin(turn)], [0, 1, 0], [np.sin(turn), 0, np.cos(turn)]])
    balls, radius_mm = body()
    views = distant_views((20.0, -10.0, -40.0, -70.0))
    grid = VoxelGrid.centred((61, 61, 61), 0.0165)
    one, turned = _seen(body(), grid=grid), _seen((balls @ rotation, radius_mm), views, grid)
    np.testing.assert_allclose(views @ rotation.T, distant_views(), atol=1e-12)
    assert turned.classes.tolist() == one.classes.tolist()
    np.testing.assert_allclose(turned.lengths_mm, one.lengths_mm, atol=0.04)


def test_a_ghost_is_told_from_what_makes_it() -> None:
    """Three threads along y: lines of sight through them meet behind and before the middle one, too."""
    balls, radius_mm = _thread((0, 1, 0))
    apart = np.concatenate([balls + [x_mm, 0, 0] for x_mm in (-0.2, 0, 0.2)])
    found = _seen((apart, radius_mm), distant_views((30.0, 0.0, -30.0)))
    assert len(found) > 3
    assert len(found.told()) == 3


def test_of_no_voxels_there_are_no_objects() -> None:
    nothing = hull_of(*_ball(1e-6), distant_views(), VoxelGrid.centred((4, 4, 4), 0.1))
    assert len(liquid_objects(nothing, connected(nothing), distant_views())) == 0
    assert set(LiquidObjects.none().columns()) == set(_seen(_ball()).columns())


def test_columns_of_a_file_are_the_objects_again() -> None:
    found = _seen(_thread((0, 1, 0)))
    columns = {
        name: column.astype("U") if column.dtype.kind == "S" else column for name, column in found.columns().items()
    }
    both = LiquidObjects.joined([LiquidObjects.of(columns), LiquidObjects.of({})])
    for name, column in found.columns().items():
        np.testing.assert_array_equal(both.columns()[name], column, name)
