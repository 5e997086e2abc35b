"""A spray that changes over its shots is told, with what changes; one whose shots only scatter is not."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from processing.analysis.spray.spray_axis import SprayAxis
from processing.analysis.spray.spray_sample import SpraySample
from processing.analysis.spray.steadiness import changes_of_spray

DOWN = SprayAxis((0, 0, 0), (0, 1, 0))
SHOTS = 10


def sample(
    seed: int = 0,
    shots: int = SHOTS,
    half_deg: Callable[[int], float] = lambda _: 20.0,
    nozzle_x_mm: Callable[[int], float] = lambda _: 0.0,
    lean: Callable[[int], float] = lambda _: 0.0,
    faster: Callable[[int], float] = lambda _: 1.0,
    larger: Callable[[int], float] = lambda _: 1.0,
    more: Callable[[int], float] = lambda _: 1.0,
    gusts: float = 0.1,
) -> SpraySample:
    """A cone of 120 droplets a shot, 8 to 12 mm from the nozzle; what it is is a function of the shot."""
    rng = np.random.default_rng(seed)
    numbers = [int(rng.poisson(120 * more(shot) * rng.gamma(1 / gusts**2, gusts**2))) for shot in range(shots)]
    shot = np.repeat(np.arange(shots), numbers)

    def of(what: Callable[[int], float]) -> np.ndarray:
        return np.array([what(number) for number in range(shots)])[shot]

    azimuth, angle = rng.uniform(0, 2 * np.pi, len(shot)), np.radians(rng.normal(of(half_deg), 2.0))
    ways = np.column_stack([np.sin(angle) * np.cos(azimuth), np.cos(angle), np.sin(angle) * np.sin(azimuth)])
    ways[:, 0] += of(lean)
    points_mm = ways * rng.uniform(8, 12, (len(shot), 1))
    points_mm[:, 0] += of(nozzle_x_mm)
    return SpraySample(
        diameters_um=40 * of(larger) * np.exp(0.35 * rng.standard_normal(len(shot))),
        points_mm=points_mm,
        velocities_m_s=15 * of(faster)[:, None] * (ways + rng.normal(0, 0.03, ways.shape)),
        shot=shot,
        volumes_mm3=np.full(shots, 400.0),
    )


def told(one: SpraySample, axis: SprayAxis | None = DOWN) -> str:
    return "\n".join(changes_of_spray(one, axis))


def test_two_sprays_one_after_the_other_are_told_with_both_angles_and_where_they_change() -> None:
    said = told(sample(half_deg=lambda shot: 30.0 if shot < 4 else 20.0))
    assert "droplets fly 30.1 degrees from their axis in the first 4 shots, 20 in 6 later" in said
    assert "means over them are of no one spray" in said
    assert "degrees from their axis" in told(sample(shots=4, half_deg=lambda shot: 30.0 if shot < 2 else 20.0), None)


@pytest.mark.parametrize(
    ("one", "what"),
    [
        (sample(nozzle_x_mm=lambda shot: 0.1 * shot), "along x they come from "),
        (sample(nozzle_x_mm=lambda shot: 1.0 * (shot > 4)), "mm beside the nozzle"),
        (sample(lean=lambda shot: 0.01 * shot), "their axis leans to x by"),
        (sample(faster=lambda shot: 1 - 0.02 * shot), "speed is "),
        (sample(larger=lambda shot: 1.3 if shot > 4 else 1.0), "D10 is "),
        (sample(more=lambda shot: 1 + 0.15 * shot), "droplets per mm3 are "),
    ],
    ids=["nozzle moves", "nozzle jumps", "axis turns", "speed drifts", "droplets grow", "rate grows"],
)
def test_whatever_changes_is_told(one: SpraySample, what: str) -> None:
    assert what in told(one)


@pytest.mark.parametrize("nozzle_moves", [True, False], ids=["nozzle nears", "cone widens"])
def test_a_cone_that_changes_is_told_without_velocities_too(nozzle_moves: bool) -> None:
    """Of single exposures, and of a nozzle that moves along the axis, places alone tell."""
    one = sample(half_deg=lambda shot: 25.0 if shot > 4 and not nozzle_moves else 20.0)
    later = (one.shot > 4) & nozzle_moves
    points_mm = one.points_mm + np.array([0, 2.0, 0]) * later[:, None]
    still = replace(one, points_mm=points_mm, velocities_m_s=np.full_like(points_mm, np.nan))
    assert "seen from the nozzle droplets lie 20 degrees from the axis in the first 5 shots" in told(still)


def _once(value: float, usual: float = 1.0) -> Callable[[int], float]:
    return lambda shot: value if shot == 7 else usual


@pytest.mark.parametrize(
    ("one", "what"),
    [
        (sample(shots=12, half_deg=_once(35.0, 20.0)), "degrees from their axis in the other shots, 34.7"),
        (sample(shots=12, faster=_once(1.5)), "m/s in the other shots, 22"),
        (sample(shots=12, larger=_once(1.6)), "um in the other shots, "),
        (sample(shots=12, nozzle_x_mm=_once(1.5, 0.0)), "mm beside the nozzle in the other shots, 1.4"),
    ],
)
def test_one_shot_that_is_another_spray_is_told(one: SpraySample, what: str) -> None:
    said = told(one)
    assert what in said
    assert "in one, the 8. of 12" in said


def test_two_sprays_in_turns_are_told_with_both_angles() -> None:
    said = told(sample(half_deg=lambda shot: 30.0 if shot % 3 else 20.0))
    assert "droplets fly 20 degrees from their axis in 40 % of the shots, 30.1 in the others, in turns" in said


def test_a_change_of_many_shots_is_told_by_groups_of_them() -> None:
    said = told(sample(shots=70, faster=lambda shot: 1.2 if shot >= 30 else 1.0))
    assert "speed is 15 m/s in the first 30 shots, 18 in 40 later" in said


def test_shots_that_only_scatter_are_no_change() -> None:
    """95 % of 60 sprays, with gusts of 10 and 40 %; 2 % were of 1800."""
    said = [
        told(sample(seed, shots=shots, gusts=gusts))
        for seed in range(20)
        for shots, gusts in ((4, 0.1), (10, 0.4), (35, 0.1))
    ]
    assert np.mean([bool(one) for one in said]) <= 0.05


def test_three_shots_tell_no_change() -> None:
    assert not told(sample(shots=3, faster=lambda shot: 1.0 + shot))


def test_a_spray_that_is_not_there_at_first_is_told() -> None:
    assert "droplets per mm3 are 0 in the first 4 shots, " in told(sample(more=lambda shot: float(shot > 3)))


def test_shots_without_droplets_or_velocities_are_no_hindrance() -> None:
    one = sample(more=lambda shot: 0.0 if shot == 3 else 1.0, faster=lambda shot: 1.3 if shot > 4 else 1.0)
    assert "speed is 15" in told(one)
    still = SpraySample(one.diameters_um, one.points_mm, np.full_like(one.points_mm, np.nan), one.shot, one.volumes_mm3)
    assert "speed" not in told(still)


def test_a_change_that_explains_all_is_told_without_a_warning() -> None:
    """The first half of the shots is empty, all others have as many droplets: nothing scatters."""
    every = sample(shots=12, gusts=0.01)
    later = np.flatnonzero(every.shot >= 6)
    rows = later[np.arange(len(later)) - np.searchsorted(every.shot[later], every.shot[later]) < 50]
    names = ("diameters_um", "points_mm", "velocities_m_s", "shot")
    kept = replace(every, volumes_mm3=np.full(12, 5.0), **{name: getattr(every, name)[rows] for name in names})
    assert "droplets per mm3 are 0 in the first 6 shots, 10 in 6 later" in told(kept)
