"""A stated nozzle or axis that the droplets contradict is told, with both places; a spray that is lopsided is not."""

import numpy as np
import pytest

from processing.analysis.spray.axis_doubts import axis_doubts
from processing.analysis.spray.proposed_axis import CUT, SWIRLS, proposed_axis
from processing.analysis.spray.spray_axis import SprayAxis
from processing.analysis.spray.spray_sample import SpraySample

DOWN = SprayAxis((0, 0, 0), (0, 1, 0))
BOX_MM = np.array([[-5.0, 8, -5], [5, 12, 5]])


def cone(
    seed: int = 0,
    half_deg: float = 20.0,
    box_mm: np.ndarray = BOX_MM,
    nozzle_mm: tuple[float, float, float] = (0, 0, 0),
    axis: tuple[float, float, float] = (0, 1, 0),
    lopsided: float = 0.0,
    swirl: float = 0.0,
    flies: bool = True,
) -> SpraySample:
    """Eight shots of 150 droplets within a box; more of them towards x where it is lopsided."""
    rng, count, shots = np.random.default_rng(seed), 3600, 8
    azimuth, angle = rng.uniform(0, 2 * np.pi, count), np.radians(rng.normal(half_deg, 1.5, count))
    ways = np.column_stack([np.sin(angle) * np.cos(azimuth), np.cos(angle), np.sin(angle) * np.sin(azimuth)])
    around = np.column_stack([-np.sin(azimuth), 0 * azimuth, np.cos(azimuth)])
    frame = SprayAxis(nozzle_mm, axis).frame[[1, 0, 2]]
    points_mm = nozzle_mm + ways * rng.uniform(6, 18, (count, 1)) @ frame
    flight = 15 * (ways + swirl * around + rng.normal(0, 0.03, ways.shape)) @ frame
    seen = ((points_mm > box_mm[0]) & (points_mm < box_mm[1])).all(axis=1)
    seen &= rng.uniform(0, 1 + lopsided, count) < 1 + lopsided * np.cos(azimuth)
    number = int(seen.sum())
    return SpraySample(
        diameters_um=np.full(number, 40.0),
        points_mm=points_mm[seen],
        velocities_m_s=flight[seen] if flies else np.full((number, 3), np.nan),
        shot=rng.integers(0, shots, number),
        volumes_mm3=np.full(shots, 400.0),
        box_mm=box_mm,
    )


def told(sample: SpraySample, axis: SprayAxis = DOWN) -> str:
    return "\n".join(axis_doubts(sample, axis, proposed_axis(sample)))


@pytest.mark.parametrize(("half_deg", "lean_deg"), [(3.0, 4.0), (10.0, 4.0), (10.0, 8.0), (20.0, 4.0), (20.0, 8.0)])
def test_an_axis_that_is_stated_aside_is_told_with_what_the_droplets_say(half_deg: float, lean_deg: float) -> None:
    said = told(cone(half_deg=half_deg, axis=(np.tan(np.radians(lean_deg)), 1, 0)))
    assert "beside the stated one, 0,1,0" in said
    assert abs(float(said.split("that is ")[1].split()[0]) - lean_deg) < 0.15 * lean_deg
    assert "--axis" in said
    assert "run's notes" in said


@pytest.mark.parametrize("nozzle_mm", [(1.0, 0, 0), (0, 3.0, 0), (0, -2.0, 0), (0.5, 0, -0.6)])
def test_a_nozzle_that_is_stated_elsewhere_is_told_with_where_lines_meet(nozzle_mm: tuple[float, float, float]) -> None:
    said = told(cone(nozzle_mm=nozzle_mm))
    assert " mm from the stated nozzle, 0,0,0 mm, at " in said
    assert "is its place stated rightly?" in said
    off_mm = float(np.linalg.norm(nozzle_mm))
    assert abs(float(said.split(" meet ")[1].split()[0]) - off_mm) < 0.1 * off_mm


def test_without_velocities_places_tell_a_nozzle_beside_the_axis() -> None:
    assert "beside the axis, seen from the stated nozzle" in told(cone(nozzle_mm=(1.0, 0, 0), flies=False))


@pytest.mark.parametrize(
    ("off_mm", "swirl", "said"), [(2.5, 0.0, "beyond"), (-4.0, 0.0, "before"), (2.5, 0.4, "beyond")]
)
def test_where_flights_tell_no_nozzle_places_tell_one_along_the_axis(off_mm: float, swirl: float, said: str) -> None:
    wide_mm = np.array([[-8.0, 8, -8], [8, 12, 8]])
    told_of = told(cone(nozzle_mm=(0, off_mm, 0), swirl=swirl, flies=swirl > 0, box_mm=wide_mm))
    assert f" mm {said} the stated nozzle, 0,0,0 mm" in told_of
    assert abs(float(told_of.split("widens from ")[1].split()[0]) - abs(off_mm)) < 0.25 * abs(off_mm)
    assert "does the spray bend?" in told_of


def test_a_nozzle_on_the_other_side_of_the_spray_is_told() -> None:
    said = told(cone(), SprayAxis((0, 20, 0), (0, -1, 0)))
    assert "meet 20 mm from the stated nozzle" in said


@pytest.mark.parametrize("flies", [True, False])
def test_what_is_stated_rightly_is_not_doubted_however_a_box_cuts_the_spray_or_lopsided_it_is(flies: bool) -> None:
    """None of 48 sprays: whole, cut at one side, wide in a narrow box, with twice as many droplets on one side."""
    one_side, narrow = np.array([[-5.0, 8, -5], [2.5, 12, 5]]), np.array([[-3.0, 8, -4], [3, 12, 3]])
    for seed in range(6):
        assert not told(cone(seed, flies=flies))
        assert not told(cone(seed, box_mm=one_side, flies=flies))
        assert not told(cone(seed, box_mm=narrow, flies=flies))
        assert not told(cone(seed, lopsided=0.35, flies=flies))


def fan(half_deg: float, box_mm: np.ndarray, axis: tuple[float, float, float] = (0, 1, 0)) -> SpraySample:
    """Flat along x, evenly in its angle."""
    whole = cone(half_deg=1.0, box_mm=np.array([[-99.0, -99, -99], [99, 99, 99]]))
    rng, count = np.random.default_rng(5), len(whole)
    angles = np.radians(np.column_stack([rng.uniform(-half_deg, half_deg, count), rng.normal(0, 2, count)]))
    ways = (
        np.column_stack([np.tan(angles[:, 0]), np.ones(count), np.tan(angles[:, 1])])
        @ SprayAxis((0, 0, 0), axis).frame[[1, 0, 2]]
    )
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    points_mm = ways * rng.uniform(4, 14, (count, 1))
    seen = ((points_mm > box_mm[0]) & (points_mm < box_mm[1])).all(axis=1)
    flight = 15 * (ways + rng.normal(0, 0.03, ways.shape))
    return SpraySample(
        whole.diameters_um[seen], points_mm[seen], flight[seen], whole.shot[seen], whole.volumes_mm3, 1.0, box_mm
    )


WIDE_MM = np.array([[-11.0, 2, -3], [11, 13, 3]])


def test_of_a_fan_the_proposal_tells_an_axis_that_is_stated_aside() -> None:
    assert not told(fan(30.0, WIDE_MM))
    assert "degrees (99 %: within" in told(fan(30.0, WIDE_MM, (0.14, 1, 0)))


def test_a_fan_that_the_box_cuts_to_one_side_has_no_axis_but_a_nozzle() -> None:
    """The mean direction would be 9 degrees aside, within half a degree."""
    found = proposed_axis(fan(30.0, np.array([[-8.0, 4, -3], [2, 11, 3]])))
    assert (found.axis, found.reason) == (None, CUT)
    assert found.nozzle_mm is not None
    assert found.believed is None
    assert CUT in found.words


def of_two_nozzles(apart_mm: float, half_deg: float) -> SpraySample:
    left, right = (cone(one, half_deg, nozzle_mm=((one - 0.5) * apart_mm, 0, 0)) for one in range(2))
    return SpraySample(
        diameters_um=np.concatenate([left.diameters_um, right.diameters_um]),
        points_mm=np.concatenate([left.points_mm, right.points_mm]),
        velocities_m_s=np.concatenate([left.velocities_m_s, right.velocities_m_s]),
        shot=np.concatenate([left.shot, right.shot]),
        volumes_mm3=left.volumes_mm3,
        box_mm=BOX_MM,
    )


@pytest.mark.parametrize("apart_mm", [2.0, 4.0])
def test_two_nozzles_around_the_stated_one_are_told(apart_mm: float) -> None:
    """Scatter of flights, 0.4 mm at the nozzle, hides no heaps 2 mm apart."""
    assert f"droplets come from places {apart_mm:.0f} mm apart" in told(of_two_nozzles(apart_mm, 8.0))


def test_two_nozzles_for_which_one_is_proposed_are_told() -> None:
    both = of_two_nozzles(2.0, 15.0)
    proposed = proposed_axis(both)
    assert proposed.believed is not None
    assert "droplets come from places 2 mm apart" in "".join(axis_doubts(both, None, proposed))
    assert axis_doubts(cone(), None, proposed_axis(cone())) == ()


@pytest.mark.parametrize("swirl", [0.1, 0.4])
def test_of_a_swirl_no_nozzle_is_proposed_and_its_axis_is(swirl: float) -> None:
    found = proposed_axis(cone(half_deg=15.0, swirl=swirl))
    assert (found.nozzle_mm, found.reason) == (None, SWIRLS)
    assert found.axis is not None
    assert found.axis[1] > 0.998
    assert not told(cone(half_deg=15.0, swirl=swirl))


def test_a_shot_without_droplets_is_no_hindrance_to_a_proposal() -> None:
    one = cone()
    with_empty = SpraySample(one.diameters_um, one.points_mm, one.velocities_m_s, one.shot + 1, np.full(9, 400.0))
    assert proposed_axis(with_empty).nozzle_mm is not None
