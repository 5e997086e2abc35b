"""Grid assignment finds the nodes of any regular pattern, whatever lies between them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from processing.calibration.target.lattice import (
    IdArray,
    Lattice,
    grow_lattice,
    on_smooth_grid,
    orient,
    place_board,
    rotate_ids,
    trim_frame,
)
from processing.geometry import FloatArray

IDS = np.array([(column, row) for row in range(12) for column in range(15)])


def perspective_px(ids: IdArray, tilt: float, roll_rad: float) -> FloatArray:
    x, y = (ids - [7, 6]).T * 30.0
    depth = 1 + tilt * x / 1000
    u, v = x * np.cos(tilt) / depth, y / depth
    cos, sin = np.cos(roll_rad), np.sin(roll_rad)
    return np.column_stack([cos * u - sin * v + 400, sin * u + cos * v + 300])


@settings(max_examples=40)
@given(tilt=st.floats(-0.8, 0.8), roll_deg=st.floats(-40, 40), missing=st.floats(0, 0.15), seed=st.integers(0, 999))
def test_every_reachable_point_gets_its_own_node(tilt: float, roll_deg: float, missing: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    points_px = perspective_px(IDS, tilt, np.deg2rad(roll_deg))
    start = int(np.flatnonzero((IDS == (7, 6)).all(axis=1))[0])
    steps_px = np.array([points_px[start + 1] - points_px[start], points_px[start + 15] - points_px[start]])
    kept = rng.random(len(IDS)) >= missing
    kept[start] = True
    clutter_px = rng.uniform(0, 800, (30, 2))
    candidates_px = np.concatenate([points_px[kept], clutter_px])

    lattice = grow_lattice(candidates_px, int(kept[:start].sum()), steps_px)

    true_ids = IDS[kept] - (7, 6)
    real = lattice.indices < kept.sum()
    assert (
        real & (lattice.ids == true_ids[np.minimum(lattice.indices, kept.sum() - 1)]).all(axis=1)
    ).sum() >= 0.9 * kept.sum()
    assert len(set(map(tuple, lattice.ids))) == len(lattice) == len(set(lattice.indices))


@given(turns=st.integers(0, 3), mirrored=st.booleans())
def test_orientation_does_not_depend_on_how_the_grid_was_grown(turns: int, mirrored: bool) -> None:
    points_px = perspective_px(IDS, 0.3, 0.1)
    grown = rotate_ids(IDS[:, ::-1] if mirrored else IDS, turns)
    oriented = orient(Lattice(grown, np.arange(len(IDS))), points_px)
    np.testing.assert_array_equal(oriented.ids - oriented.ids.min(axis=0), IDS)


def test_frame_and_stray_points_are_trimmed() -> None:
    inside = (IDS >= 1).all(axis=1) & (IDS < (14, 11)).all(axis=1)
    strength = np.where(inside, 1.0, 0.5)
    stray = np.array([[20, 5], [7, -1]])
    lattice = Lattice(np.concatenate([IDS, stray]), np.arange(len(IDS) + 2))
    board = trim_frame(lattice, np.append(strength, [1.0, 1.0]))
    np.testing.assert_array_equal(board.ids, IDS[inside])


@given(missing=st.sets(st.integers(0, 179), max_size=12), light=st.floats(-0.04, 0.04))
def test_uneven_light_and_missing_corners_are_not_trimmed(missing: set[int], light: float) -> None:
    kept = np.array([index for index in range(len(IDS)) if index not in missing])
    board = trim_frame(Lattice(IDS[kept], kept), np.exp(light * IDS.sum(axis=1)))
    assert len(board) > 0.7 * len(kept)


def test_board_turned_by_ninety_degrees_is_recognised_by_its_shape() -> None:
    board = place_board(Lattice(IDS, np.arange(len(IDS))), 12, 15)
    assert board is not None
    np.testing.assert_array_equal(np.ptp(board.ids, axis=0) + 1, (12, 15))


@pytest.mark.parametrize("size", [(16, 12), (15, 11), (14, 12), (12, 12)])
def test_board_of_another_size_is_not_guessed(size: tuple[int, int]) -> None:
    assert place_board(Lattice(IDS, np.arange(len(IDS))), *size) is None


def test_shifted_points_leave_the_smooth_grid_alone() -> None:
    points_px = perspective_px(IDS, 0.5, 0.1)
    points_px[[17, 80]] += (0.6, -0.5)
    np.testing.assert_array_equal(np.flatnonzero(~on_smooth_grid(IDS, points_px)), [17, 80])
