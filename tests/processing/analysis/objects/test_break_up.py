"""How far liquid hangs together with the nozzle: known lengths, and all cases in which nothing is known."""

from dataclasses import replace

import numpy as np
import pytest

from processing.analysis.objects.break_up import TELLING, THRESHOLD, THRESHOLDS, Nozzle, Reach, reach_of
from processing.analysis.objects.connected_share import break_up_of, connected_share
from processing.analysis.objects.dark_voxels import FULL, DarkVoxels
from processing.volume import VoxelGrid

GRID = VoxelGrid.centred((40, 81, 40), 0.1)
NOZZLE = Nozzle((0.0, -3.0, 0.0))


def _column(first_mm: float, last_mm: float, darkness: float = 0.45, width: int = 3) -> DarkVoxels:
    """A square column along y."""
    volume = np.zeros(GRID.shape, np.uint8)
    rows = (GRID.y_mm >= first_mm - 1e-9) & (GRID.y_mm <= last_mm + 1e-9)
    middle = slice(20 - width // 2, 21 + width // 2)
    volume[middle, :, middle] = np.where(rows, round(darkness * FULL), 0)[:, None]
    numbers = np.flatnonzero(volume)
    return DarkVoxels(GRID, numbers, volume.ravel()[numbers])


def test_a_column_reaches_as_far_as_it_is_dark_enough() -> None:
    reach = reach_of(_column(-3.0, 1.0), NOZZLE)
    assert reach.thresholds == THRESHOLDS
    np.testing.assert_allclose(reach.reach_mm, [4.05, 4.05, 4.05, 0.0])
    assert reach.open == (False,) * 4


def test_lengths_are_along_the_axis() -> None:
    tilted = Nozzle((0.0, -3.0, 0.0), (0.0, 3.0, 4.0))
    reach = reach_of(_column(-3.0, 1.0), tilted)
    np.testing.assert_allclose(reach.reach_mm[0], 0.6 * 4.0 + 0.8 * 0.1, atol=0.1)


def test_what_leaves_the_field_is_longer_than_told() -> None:
    reach = reach_of(_column(-3.0, 4.0), NOZZLE)
    assert reach.open[:3] == (True,) * 3
    found = break_up_of([reach])
    assert (found.value_mm, found.low_mm, found.high_mm) == (None, None, None)
    assert found.longer_than_mm == pytest.approx(7.05)
    assert "longer than 7.05 mm" in (found.reason or "")


def test_liquid_that_leaves_the_field_behind_the_nozzle_ends_before_it() -> None:
    """The nozzle is stated downstream of where it is, or is seen itself: nothing leaves along the axis."""
    reach = reach_of(_column(-4.0, 1.0), Nozzle((0.0, -2.5, 0.0)))
    assert reach.open == (False,) * 4
    found = break_up_of([reach])
    assert found.value_mm == pytest.approx(3.55)
    assert "in 1 of 1 shot what hangs together goes 1.50 mm behind the nozzle" in (found.reason or "")


@pytest.mark.parametrize("first_mm", [-3.2, -3.0, -2.8])
def test_liquid_that_begins_about_the_nozzle_is_not_behind_it(first_mm: float) -> None:
    found = break_up_of([reach_of(_column(first_mm, 1.0), NOZZLE)])
    assert found.value_mm == pytest.approx(4.05)
    assert found.reason is None


@pytest.mark.parametrize(
    ("voxels", "nozzle", "reason"),
    [
        (_column(-1.0, 1.0), NOZZLE, "no liquid within 0.3 mm of the nozzle at 0, -3, 0 mm"),
        (_column(-3.0, 1.0), Nozzle((0.0, -4.6, 0.0)), "lies outside of what all views see"),
        (_column(-3.0, 1.0, darkness=1.0, width=15), NOZZLE, "all views are black over 1.5 mm"),
        (_column(-3.0, 1.0), Nozzle((0.0, -3.0, 0.0), (0.0, -1.0, 0.0)), "goes 4.01 mm from the nozzle, but 0.05 mm"),
        (_column(-3.0, 1.0), Nozzle((0.0, -3.0, 0.0), (0.0, 0.0, 1.0)), "is the axis stated rightly"),
    ],
)
def test_where_nothing_is_known_it_is_said_why(voxels: DarkVoxels, nozzle: Nozzle, reason: str) -> None:
    reach = reach_of(voxels, nozzle)
    assert reason in (reach.reason or "")
    assert reason in (break_up_of([reach]).reason or "")


def _reaches(*lengths_mm: float, open_from: float = np.inf) -> list[Reach]:
    return [Reach(THRESHOLDS, (mm,) * 4, (mm >= open_from,) * 4, 0.01) for mm in lengths_mm]


def test_the_break_up_length_is_where_half_of_the_shots_hang_together() -> None:
    found = break_up_of(_reaches(4.0, 5.0, 6.0, 7.0, 8.0))
    assert found.value_mm == 6.0
    assert found.low_mm is not None
    assert found.high_mm is not None
    assert 3.8 < found.low_mm < 6.0 < found.high_mm < 8.1
    assert break_up_of(_reaches(4.0, 5.0, 6.0, 7.0)).value_mm == 5.5


def test_shots_that_leave_the_field_count_as_longer() -> None:
    lengths_mm = (4.0, 5.0, 6.0, 7.0, 7.0)
    assert break_up_of(_reaches(*lengths_mm, open_from=7.0)).value_mm == 6.0
    assert break_up_of(_reaches(*lengths_mm, open_from=6.0)).longer_than_mm == 6.0


def test_limits_tell_how_it_depends_on_the_threshold() -> None:
    depends = Reach(THRESHOLDS, (6.0, 5.0, 3.0, 2.0), (False,) * 4, 0.01)
    found = break_up_of([depends] * 5)
    assert found.value_mm == 5.5
    assert found.low_mm is not None
    assert found.high_mm is not None
    assert 4.5 < found.low_mm < 5.0
    assert 6.0 < found.high_mm < 6.3
    assert (THRESHOLDS[:2], THRESHOLDS[1]) == (TELLING, THRESHOLD)


def test_shots_count_in_parts_where_thresholds_disagree() -> None:
    depends = [Reach(THRESHOLDS, (6.0 + shot, 3.0, 2.0, 1.0), (False,) * 4, 0.01) for shot in range(2)]
    assert break_up_of(depends).value_mm == 4.5
    share = connected_share(depends, np.array([2.5, 3.5, 6.5, 7.5])).share
    np.testing.assert_allclose(share, [1, 2 / 4, 1 / 4, 0])


def test_shots_of_which_it_is_not_known_are_counted() -> None:
    known = _reaches(4.0, 5.0)
    assert (break_up_of(known).shots, break_up_of(known).reason) == (2, None)
    some = break_up_of([*known, Reach(reason="all views are black"), Reach(reason="all views are black")])
    assert (some.value_mm, some.shots) == (break_up_of(known).value_mm, 2)
    assert some.reason == "not known of 2 of 4 shots: all views are black"
    longer = break_up_of([*_reaches(5.0, open_from=0.0), Reach(reason="all views are black")])
    assert "leaves the field: longer than 5.00 mm; not known of 1 of 2 shots" in (longer.reason or "")


def test_bodies_that_lie_apart_are_told_and_are_in_the_limits() -> None:
    known = _reaches(4.0, 4.1, 4.2)
    apart = break_up_of([*(replace(shot, apart_mm=(5.0, 9.0)) for shot in known[:2]), known[2]])
    assert (apart.value_mm, apart.low_mm) == (break_up_of(known).value_mm, break_up_of(known).low_mm)
    assert apart.high_mm == 9.0
    assert "in 2 of 3 shots a large body, 5.00 to 9.00 mm from the nozzle" in (apart.reason or "")
    assert break_up_of(known).reason is None


def test_the_curve_falls_from_one_and_is_unknown_beyond_the_field() -> None:
    distances_mm = np.array([0.0, 3.9, 4.1, 5.5, 6.5])
    closed = connected_share(_reaches(4.0, 5.0, 6.0), distances_mm)
    np.testing.assert_allclose(closed.share, [1, 1, 2 / 3, 1 / 3, 0])
    assert np.all((closed.low <= closed.share) & (closed.share <= closed.high))
    opened = connected_share(_reaches(4.0, 5.0, 6.0, open_from=6.0), distances_mm)
    np.testing.assert_allclose(opened.share, [1, 1, 2 / 3, 1 / 3, np.nan])
