"""Intervals over shots are of shots that differ: where successive ones show the same droplets, that is told."""

from pathlib import Path

import numpy as np
import pytest

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.lingering_droplets import lingering_told
from processing.analysis.spray.spray_sample import spray_sample
from processing.analysis.spray.spray_statistics import spray_statistics
from processing.analysis.spray.steadiness import changes_of_spray
from processing.runs.sprays.measured_spray import read_compared
from tests.support.sampled_sprays import cone_shots, stored_shot, write_results

LOW_MM, EXTENT_MM = np.array([-4.95, 8.05, -4.95]), np.array([9.9, 3.9, 9.9])
SAME = "shots show the same droplets"


def series(
    count: int, way_mm: float, scatter: float = 0.05, shots: int = 6, spread: float = 0.3
) -> list[StoredDroplets]:
    """Droplets that fly along y; where one has left the box, another one comes in."""
    rng = np.random.default_rng(7)
    places = LOW_MM + EXTENT_MM * rng.random((count, 3))
    diameters = 45 * np.exp(spread * rng.normal(size=count))
    steps = np.array([0, way_mm, 0]) + scatter * way_mm * rng.normal(size=(count, 3))
    seen = []
    for shot in range(shots):
        noise = rng.normal(0, 0.001, (count, 3))
        seen.append(stored_shot(diameters * np.exp(0.01 * rng.normal(size=count)), places + noise, shot=shot))
        places = places + steps
        gone = ((places < LOW_MM) | (places > LOW_MM + EXTENT_MM)).any(axis=1)
        places[gone] = LOW_MM + EXTENT_MM * rng.random((gone.sum(), 3)) * (1, 0.1, 1)
        diameters = np.where(gone, 45 * np.exp(spread * rng.normal(size=count)), diameters)
    return seen


@pytest.mark.parametrize(("count", "way_mm", "scatter"), [(150, 0.05, 0.05), (12, 0.5, 0.1), (600, 1.0, 0.05)])
def test_a_series_in_time_is_no_sample_of_many_shots(count: int, way_mm: float, scatter: float) -> None:
    told = "".join(lingering_told(series(count, way_mm, scatter)))
    assert SAME in told
    assert float(told.split("next one, ")[1].split(" mm")[0]) == pytest.approx(way_mm, rel=0.15)


def test_statistics_doubt_the_limits_of_such_shots() -> None:
    assert SAME in "".join(spray_statistics(series(40, 0.2, shots=3)).doubts)


def test_such_shots_are_not_told_as_a_spray_that_changes() -> None:
    """Their figures drift as droplets come and go: chance is that of few droplets, not that of shots."""
    slow = series(60, 0.2, shots=20)
    assert changes_of_spray(spray_sample(slow))
    assert "changes over its shots" not in "".join(spray_statistics(slow).doubts)


def test_droplets_all_alike_and_dirt_that_stays_are_told() -> None:
    assert lingering_told(series(150, 0.3, spread=0.001))
    assert lingering_told(series(60, 0.0))


@pytest.mark.parametrize("reverse", [False, True])
def test_the_order_of_files_does_not_matter(reverse: bool) -> None:
    shots = series(100, 0.8)
    assert lingering_told(shots[::-1] if reverse else [*shots[1::2], *shots[::2]])


@pytest.mark.parametrize(("shots", "count"), [(2, 60), (3, 20), (8, 150), (40, 20), (4, 800)])
@pytest.mark.parametrize("half_angle_deg", [20.0, 4.0])
def test_shots_of_one_spray_are_no_such_series(shots: int, count: int, half_angle_deg: float) -> None:
    for seed in range(5):
        assert not lingering_told(cone_shots(seed, shots, count, half_angle_deg))


def test_droplets_all_alike_that_are_others_in_each_shot_are_no_series() -> None:
    assert not lingering_told(series(150, 20.0, spread=0.001))


def test_comparing_tells_it_of_each_spray(tmp_path: Path) -> None:
    folders = [
        write_results(tmp_path / "series", series(60, 0.2)),
        write_results(tmp_path / "spray", cone_shots(1, 4, 60), run="another"),
    ]
    told = [one for one in read_compared(folders).unlike if SAME in one]
    assert [one.split(":")[0] for one in told] == ["series"]
