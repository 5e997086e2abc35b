"""Velocities in m/s, their covariance, and verdicts: what must not be believed says so."""

from dataclasses import replace

import numpy as np
import pytest

from processing.analysis.droplets.measured_exposure import ShotVerdict
from processing.analysis.velocity.measured_velocities import MeasuredVelocities, measure_velocities
from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.volume import VoxelGrid
from tests.support.measured_exposures import GRID, PITCH_MM, measured
from tests.support.moving_droplets import BOX, Exposed, exposures


def of(first: Exposed, second: Exposed, separation_ns: float = 6400.0) -> MeasuredVelocities:
    return measure_velocities(measured(first), measured(second), GRID, separation_ns)


def few(exposed: Exposed, count: int) -> Exposed:
    return exposed.reordered(np.arange(count))


def refused(velocities: MeasuredVelocities, reason: str) -> bool:
    """No droplet has a velocity or a partner, and it says why."""
    for side in (velocities.first, velocities.second):
        assert np.isnan(side.velocities_m_s).all()
        assert np.isnan(side.covariance_m2_s2).all()
        assert np.all(side.partners.partner == -1)
    assert velocities.mean_m_s is None
    return velocities.verdict is ShotVerdict.REFUSED and reason in velocities.reasons[0]


@pytest.mark.parametrize("separation_ns", [6.4, 6.4e-6])
def test_a_separation_in_another_unit_is_doubted(separation_ns: float) -> None:
    first, second = exposures()
    velocities = of(first, second, separation_ns)
    assert velocities.verdict is ShotVerdict.DOUBTFUL
    assert f"faster than any spray: is the separation of {separation_ns:g} ns right?" in velocities.reasons[-1]


@pytest.mark.parametrize(("rows", "doubted"), [(40, True), (300, False)])
def test_a_mean_that_lacks_fast_droplets_as_they_leave_the_box_is_doubted(rows: int, doubted: bool) -> None:
    first, second, true = core_and_edge(rows)
    grid = VoxelGrid((200, rows, 300), (0.0, 0.0, 0.0), PITCH_MM)
    velocities = measure_velocities(measured(first, grid), measured(second, grid), grid, 6400.0)
    speed_m_s = np.linalg.norm(velocities.first.velocities_m_s[velocities.first.paired], axis=1).mean()
    assert (speed_m_s < 0.96 * true * PITCH_MM * 1e-3 / 6400e-9) == doubted
    assert (velocities.verdict is ShotVerdict.DOUBTFUL) == doubted
    assert any("leave the box between A and B more often" in reason for reason in velocities.reasons) == doubted


def core_and_edge(rows: int) -> tuple[Exposed, Exposed, float]:
    """Droplets that fly along y, fast in the middle of a box and slowly beside it; and the mean way of those in A."""
    rng, box = np.random.default_rng(3), np.array([300, rows, 200])
    places = rng.uniform((0, -40, 0), box + (0, 40, 0), (round(6 * (rows + 80)), 3))
    away = np.linalg.norm((places - box / 2)[:, [0, 2]], axis=1)
    way = 5 + 17 * np.exp(-((away / 60) ** 2))
    ends = places, places + np.outer(way, [0, 1, 0]) + rng.normal(0, 0.1, places.shape)
    seen = []
    for there in ends:
        (labels,) = np.nonzero(np.all((there > 0) & (there < box - 1), axis=1))
        covariance = np.tile(0.04**2 * np.eye(3), (len(labels), 1, 1))
        seen.append(Exposed(MovingDroplets(there[labels], covariance, np.sin(labels)), labels))
    return seen[0], seen[1], float(way[seen[0].labels].mean())


def test_a_grid_that_they_were_not_measured_in_is_refused() -> None:
    first, second = map(measured, exposures())
    elsewhere = VoxelGrid(GRID.shape, (10.0, 1.0, 0.5), PITCH_MM)
    with pytest.raises(ValueError, match="droplets lie outside of the grid"):
        measure_velocities(first, second, elsewhere, 6400)


def test_a_velocity_is_the_way_over_the_time() -> None:
    first, second = exposures(noise=0.0, ghosts=0.05)
    velocities = of(first, second)
    assert velocities.verdict is ShotVerdict.GOOD
    place = {label: row for row, label in enumerate(second.labels.tolist())}
    for row in np.nonzero(velocities.first.paired)[0][:50]:
        way_mm = (second.droplets.places[place[first.labels[row]]] - first.droplets.places[row]) * PITCH_MM
        np.testing.assert_allclose(velocities.first.velocities_m_s[row], way_mm * 1e-3 / 6400e-9)


def test_both_droplets_of_a_pair_have_its_velocity_and_the_others_none() -> None:
    first, second = exposures(found=0.9, ghosts=0.1)
    velocities = of(first, second)
    (own,) = np.nonzero(velocities.first.paired)
    other = velocities.first.partners.partner[own]
    np.testing.assert_array_equal(velocities.first.velocities_m_s[own], velocities.second.velocities_m_s[other])
    for side in (velocities.first, velocities.second):
        np.testing.assert_array_equal(np.isnan(side.velocities_m_s).all(axis=1), ~side.paired)
        assert 0.02 < np.mean(~side.paired) < 0.4


def test_columns_name_the_row_of_the_partner_in_the_whole_table() -> None:
    velocities = of(*exposures(found=0.9))
    tables = velocities.columns()
    partner = np.concatenate([tables["a"]["partner"], tables["b"]["partner"]])
    speed = np.concatenate([tables["a"]["u_m_s"], tables["b"]["u_m_s"]])
    (rows,) = np.nonzero(partner >= 0)
    np.testing.assert_array_equal(partner[partner[rows]], rows)
    np.testing.assert_array_equal(speed[partner[rows]], speed[rows])
    assert np.all((rows < len(velocities.first)) == (partner[rows] >= len(velocities.first)))


def test_errors_are_as_large_as_the_covariance_says() -> None:
    exact, moved = exposures(noise=0.0)
    noisy = []
    for seed, exposed in enumerate((exact, moved)):
        rng, count = np.random.default_rng(seed), len(exposed.labels)
        roots = rng.normal(0, 0.05, (count, 3, 3))
        places = exposed.droplets.places + np.einsum("nij,nj->ni", roots, rng.normal(size=(count, 3)))
        covariance = np.einsum("nij,nkj->nik", roots, roots)
        noisy.append(replace(exposed, droplets=MovingDroplets(places, covariance, exposed.droplets.log_sizes)))
    true, seen = of(exact, moved), of(noisy[0], noisy[1])
    both = true.first.paired & seen.first.paired & (true.first.partners.partner == seen.first.partners.partner)
    errors = (seen.first.velocities_m_s - true.first.velocities_m_s)[both][..., None]
    squares = np.sum(errors * np.linalg.solve(seen.first.covariance_m2_s2[both], errors), axis=(1, 2))
    assert np.mean(both) > 0.8
    assert np.median(squares) == pytest.approx(2.366, rel=0.15)  # of chi squared with three degrees of freedom


@pytest.mark.parametrize("pitch_mm", [1 / 240, 1.0])
def test_the_scale_of_the_grid_scales_velocities_alone(pitch_mm: float) -> None:
    first, second = exposures(found=0.95, ghosts=0.05)
    plain, other = of(first, second), VoxelGrid(GRID.shape, (7.0, 8.0, 9.0), pitch_mm)
    scaled = measure_velocities(measured(first, other), measured(second, other), other, 6400.0)
    np.testing.assert_array_equal(plain.first.partners.partner, scaled.first.partners.partner)
    np.testing.assert_allclose(
        scaled.first.velocities_m_s, plain.first.velocities_m_s * pitch_mm / PITCH_MM, rtol=1e-6, atol=1e-6
    )
    assert plain.stayed == scaled.stayed


def test_half_the_separation_is_twice_the_velocity() -> None:
    first, second = exposures()
    slow, fast = of(first, second, 6400), of(first, second, 3200)
    np.testing.assert_allclose(fast.first.velocities_m_s, 2 * slow.first.velocities_m_s)
    np.testing.assert_allclose(fast.first.covariance_m2_s2, 4 * slow.first.covariance_m2_s2)


def test_exchanged_exposures_turn_velocities_round() -> None:
    first, second = exposures(found=0.95, ghosts=0.05)
    forth, back = of(first, second), of(second, first)
    both = forth.first.partners.partner == back.second.partners.partner
    assert np.mean(both) > 0.995
    np.testing.assert_allclose(forth.first.velocities_m_s[both], -back.second.velocities_m_s[both])


def test_droplets_that_leave_the_grid_are_not_missed() -> None:
    velocities = of(*exposures(density_per_mm3=56, shift=(12.0, 12.0, 0.0)))
    assert velocities.pairs < 0.85 * len(velocities.first)
    assert velocities.share_paired is not None
    assert velocities.share_paired > 0.99


@pytest.mark.parametrize("seed", range(3))
def test_two_shots_are_refused(seed: int) -> None:
    first, second = exposures(seed)[0], exposures(seed + 50)[1]
    velocities = of(first, second)
    assert refused(velocities, "no motion in common") or refused(velocities, "have a partner")


def test_two_shots_with_the_same_dirt_are_refused() -> None:
    """What stands still in both shots, in a corner, is a motion in common."""
    rng, count = np.random.default_rng(3), 30
    dirt, looks = rng.uniform(0, 0.25 * BOX, (count, 3)), rng.normal(0, 0.5, count)
    dirty = []
    for seed in (1, 2):
        seen = exposures(seed, noise=0.03)[0]
        droplets = MovingDroplets(
            np.vstack([seen.droplets.places, dirt + rng.normal(0, 0.03, dirt.shape)]),
            np.concatenate([seen.droplets.covariance, np.tile(1e-3 * np.eye(3), (count, 1, 1))]),
            np.append(seen.droplets.log_sizes, looks),
        )
        dirty.append(Exposed(droplets, np.append(seen.labels, np.arange(count) + 10**6)))
    assert refused(
        of(dirty[0], dirty[1]), "% of the droplets that should be in both exposures have a partner, limit 10 %"
    )


def test_the_same_exposure_twice_is_refused() -> None:
    first, _ = exposures()
    assert refused(of(first, first), "one image is there twice")


def test_droplets_that_stand_still_are_paired() -> None:
    first, second = exposures(shift=(0.0, 0.0, 0.0), scatter=0.0)
    assert of(first, second).verdict is ShotVerdict.GOOD


@pytest.mark.parametrize(("way_voxel", "still"), [(0.0, True), (0.3, False)])
def test_where_none_is_known_to_move_velocities_are_doubtful(way_voxel: float, still: bool) -> None:
    """Both exposures in one flash, each with noise of its own: nothing moves, and all droplets have a partner."""
    first, _ = exposures()
    noise = np.random.default_rng(2).normal(0, 0.05, first.droplets.places.shape)
    velocities = of(first, first.placed(first.droplets.places + noise + (0, way_voxel, 0)))
    assert velocities.verdict is (ShotVerdict.DOUBTFUL if still else ShotVerdict.GOOD)
    assert any("stand still" in reason for reason in velocities.reasons) == still


@pytest.mark.parametrize("counts", [(1, 1), (1, 200), (200, 1), (2, 2)])
def test_too_few_droplets_are_refused(counts: tuple[int, int]) -> None:
    first, second = (few(one, count) for one, count in zip(exposures(), counts, strict=True))
    assert refused(
        of(first, second), f"the {counts[0]} droplets of A and the {counts[1]} of B have no motion in common"
    )


@pytest.mark.parametrize("empty", [0, 1])
def test_an_exposure_without_droplets_says_so(empty: int) -> None:
    both = [measured(one) for one in exposures()]
    both[empty] = measured(few(exposures()[0], 0), verdict=ShotVerdict.EMPTY)
    velocities = measure_velocities(both[0], both[1], GRID, 6400)
    assert velocities.verdict is ShotVerdict.EMPTY
    assert f"exposure {'AB'[empty]} is empty" in velocities.reasons[0]
    assert (velocities.pairs, velocities.share_paired, velocities.wrong_share) == (0, None, None)


def test_velocities_are_no_better_than_the_exposures() -> None:
    first, second = exposures()
    doubtful = measure_velocities(measured(first), measured(second, verdict=ShotVerdict.DOUBTFUL), GRID, 6400)
    assert (doubtful.verdict, doubtful.reasons) == (ShotVerdict.DOUBTFUL, ("exposure B is doubtful",))
    nothing = measured(few(second, 0), verdict=ShotVerdict.REFUSED)
    assert refused(measure_velocities(measured(first), nothing, GRID, 6400), "exposure B is refused")


def test_few_partners_are_doubtful() -> None:
    velocities = of(*exposures(found=0.45, ghosts=0.5))
    assert velocities.verdict is ShotVerdict.DOUBTFUL
    assert "have a partner, limit 50 %" in velocities.reasons[0]
    assert velocities.pairs


def test_ambiguous_partners_are_doubtful() -> None:
    velocities = of(*exposures(density_per_mm3=100, scatter=1.6, unlikeness=0.6))
    assert velocities.verdict is ShotVerdict.DOUBTFUL
    assert "wrong by their own probabilities" in velocities.reasons[0]


@pytest.mark.parametrize("separation_ns", [0, -6400, np.inf, np.nan])
def test_a_separation_that_is_none_is_refused(separation_ns: float) -> None:
    with pytest.raises(ValueError, match=r"separation .* must be above 0"):
        of(*exposures(), separation_ns)
