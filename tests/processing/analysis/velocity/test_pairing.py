"""Pairs of droplets whose partners are known, and what must not change them."""

from dataclasses import replace

import numpy as np
import pytest

from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.analysis.velocity.pairing import Pairing, pair
from tests.support.moving_droplets import BOX, Exposed, exposures, in_both, right


def found_pairs(pairing: Pairing, first: Exposed, second: Exposed) -> set[tuple[int, int]]:
    """Pairs by labels."""
    own, other = pairing.pairs
    return set(zip(first.labels[own].tolist(), second.labels[other].tolist(), strict=True))


@pytest.mark.parametrize(
    ("scene", "least_recall", "least_precision"),
    [
        ({"density_per_mm3": 3.0}, 0.98, 1.0),
        ({"density_per_mm3": 56.0}, 0.998, 0.999),
        ({"scatter": 1.0}, 0.99, 0.995),
        ({"found": 0.9, "ghosts": 0.1}, 0.99, 0.995),
        ({"shift": (20.0, -12.0, 8.0)}, 0.99, 0.999),
        ({"shift": (0.0, 0.0, 0.0)}, 0.99, 0.999),
    ],
)
def test_droplets_find_their_partners_without_a_guess(
    scene: dict[str, float], least_recall: float, least_precision: float
) -> None:
    first, second = exposures(**scene)  # type: ignore[arg-type]
    own, other = pair(first.droplets, second.droplets).pairs
    good = right(first, second, own, other)
    assert np.count_nonzero(good) >= least_recall * in_both(first, second)
    assert np.mean(good) >= least_precision


def test_partners_are_mutual_and_ambiguity_is_kept() -> None:
    first, second = exposures(density_per_mm3=56, scatter=1.5, found=0.9, ghosts=0.1)
    pairing = pair(first.droplets, second.droplets)
    own, other = pairing.pairs
    np.testing.assert_array_equal(pairing.second.partner[other], own)
    assert np.count_nonzero(pairing.second.partner >= 0) == len(own)
    for side in (pairing.first, pairing.second):
        assert np.all(side.p_pair >= side.p_runner_up)
        assert np.all(side.p_pair + side.p_runner_up <= 1 + 1e-12)
        np.testing.assert_array_equal(side.partner >= 0, side.p_pair > 0.5)
    assert pairing.first.p_runner_up.max() > 0.2


def test_probabilities_are_what_they_say() -> None:
    likely, good = [], []
    for seed in range(3):
        first, second = exposures(seed, density_per_mm3=56, scatter=2.5, found=0.9, ghosts=0.1, noise=0.02)
        pairing = pair(first.droplets, second.droplets)
        own, other = pairing.pairs
        likely.append(pairing.first.p_pair[own])
        good.append(right(first, second, own, other))
    p_pair, is_right = np.concatenate(likely), np.concatenate(good)
    unsure = p_pair < 0.95
    assert np.count_nonzero(unsure) > 30
    assert np.mean(is_right[unsure]) == pytest.approx(np.mean(p_pair[unsure]), abs=0.12)
    assert np.mean(~is_right) == pytest.approx(np.mean(1 - p_pair), rel=0.6)


def test_the_spread_of_partners_is_found() -> None:
    first, second = exposures(density_per_mm3=56, scatter=0.5, noise=0.3)
    spread = pair(first.droplets, second.droplets).spread
    assert spread.scatter == pytest.approx(0.56, rel=0.12)  # with the error of the motion around
    assert spread.unlikeness == pytest.approx(0.03 * np.sqrt(2), rel=0.1)


def test_sizes_tell_partners_apart_where_places_do_not() -> None:
    first, second = exposures(density_per_mm3=70, scatter=2.0)
    alike = [replace(one.droplets, log_sizes=np.zeros(len(one.droplets))) for one in (first, second)]
    by_size, by_place = pair(first.droplets, second.droplets), pair(*alike)
    counts = [np.count_nonzero(right(first, second, *one.pairs)) for one in (by_size, by_place)]
    assert counts[0] > 0.96 * in_both(first, second) > 1.04 * counts[1]


def test_the_order_of_droplets_does_not_matter() -> None:
    first, second = exposures(found=0.95, ghosts=0.05)
    rng = np.random.default_rng(3)
    mixed = [one.reordered(rng.permutation(len(one.labels))) for one in (first, second)]
    plain, other = pair(first.droplets, second.droplets), pair(mixed[0].droplets, mixed[1].droplets)
    assert found_pairs(plain, first, second) == found_pairs(other, *mixed)
    np.testing.assert_allclose(np.sort(plain.first.p_pair), np.sort(other.first.p_pair), atol=1e-9)


@pytest.mark.parametrize("axes", [(-1, 1, 1), (1, -1, -1)])
def test_mirrored_droplets_have_the_same_partners(axes: tuple[int, int, int]) -> None:
    first, second = exposures(found=0.95, ghosts=0.05)
    mirrored = [one.placed(one.droplets.places * axes) for one in (first, second)]
    plain, other = pair(first.droplets, second.droplets), pair(mirrored[0].droplets, mirrored[1].droplets)
    assert found_pairs(plain, first, second) == found_pairs(other, *mirrored)


def test_turned_axes_make_no_difference() -> None:
    first, second = exposures(found=0.95, ghosts=0.05)
    turned = [one.placed(one.droplets.places[:, ::-1]) for one in (first, second)]
    plain, other = pair(first.droplets, second.droplets), pair(turned[0].droplets, turned[1].droplets)
    assert found_pairs(plain, first, second) == found_pairs(other, *turned)


def test_exchanged_exposures_have_the_same_pairs() -> None:
    first, second = exposures(found=0.95, ghosts=0.05)
    there, back = pair(first.droplets, second.droplets), pair(second.droplets, first.droplets)
    forth = found_pairs(there, first, second)
    reverse = {(one, other) for other, one in found_pairs(back, second, first)}
    assert len(forth ^ reverse) <= 0.003 * len(forth)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("density_per_mm3", [1.0, 28.0, 56.0])
def test_droplets_of_two_shots_have_no_partners(seed: int, density_per_mm3: float) -> None:
    first, _ = exposures(seed, density_per_mm3)
    _, second = exposures(seed + 100, density_per_mm3)
    pairing = pair(first.droplets, second.droplets)
    assert len(pairing.pairs[0]) <= 0.01 * len(first.labels)


def test_two_shots_of_a_thin_spray_have_no_partners() -> None:
    """Droplets lie in a layer, so that displacements are no even fog."""
    flat = []
    for seed in (1, 2):
        one, _ = exposures(seed, 56)
        thin = one.droplets.places.copy()
        thin[:, 1] = 40 + 0.05 * thin[:, 1]
        flat.append(replace(one.droplets, places=thin))
    assert len(pair(*flat).pairs[0]) <= 0.01 * len(flat[0])


def test_a_row_of_evenly_spaced_droplets_does_not_tell_how_far_it_went() -> None:
    row = np.column_stack([8.0 * np.arange(40), np.full(40, 20.0), np.full(40, 20.0)])
    rng, covariance = np.random.default_rng(1), np.tile(1e-4 * np.eye(3), (40, 1, 1))
    first, second = (
        MovingDroplets(row + shift + rng.normal(0, 0.01, row.shape), covariance, rng.normal(0, 0.01, 40))
        for shift in ((0, 0, 0), (10, 0, 0))
    )
    assert not len(pair(first, second).pairs[0])


def test_a_motion_beyond_reach_is_not_found() -> None:
    first, second = exposures(shift=(32.0, 0.0, 0.0))
    assert not len(pair(first.droplets, second.droplets).pairs[0])


@pytest.mark.parametrize(("firsts", "seconds"), [(0, 0), (0, 5), (5, 0), (1, 1), (1, 5), (2, 2)])
def test_hardly_any_droplets_have_no_partners(firsts: int, seconds: int) -> None:
    first, second = exposures()
    few = [one.reordered(np.arange(count)) for one, count in ((first, firsts), (second, seconds))]
    pairing = pair(few[0].droplets, few[1].droplets)
    assert (len(pairing.first.partner), len(pairing.second.partner)) == (firsts, seconds)
    assert not len(pairing.pairs[0])
    assert pairing.shifts is None


def test_five_droplets_far_apart_are_paired() -> None:
    rng = np.random.default_rng(1)
    places = rng.uniform(0, BOX * 3, (5, 3))
    first, second = (
        MovingDroplets(places + shift, np.tile(1e-3 * np.eye(3), (5, 1, 1)), np.zeros(5))
        for shift in ((0, 0, 0), (9, 2, -4))
    )
    np.testing.assert_array_equal(pair(first, second).first.partner, np.arange(5))


def test_one_droplet_that_is_known_badly_does_not_cost_the_others_their_partners() -> None:
    """A droplet behind another one is known to some voxels; the motion around all others is known to 0.1 voxel."""
    paired = 0.0
    for seed in range(4):
        first, second = exposures(seed, density_per_mm3=3.0, scatter=0.15, noise=0.01)
        covariance = first.droplets.covariance.copy()
        covariance[np.argmin(np.linalg.norm(first.droplets.places - BOX / 2, axis=1))] = np.diag([5.0, 4.0, 15.0])
        known = replace(first.droplets, covariance=covariance)
        paired += len(pair(known, second.droplets).pairs[0]) / in_both(first, second) / 4
    assert paired > 0.97


@pytest.mark.parametrize("seed", [2, 3, 10, 11])
def test_few_droplets_whose_speed_goes_with_their_size_are_paired(seed: int) -> None:
    """Nowhere do half of them go one way; pairs of two sizes are left aside."""
    rng = np.random.default_rng(seed)
    places, log_sizes = rng.uniform(0, (240, 50, 240), (14, 3)), np.log(rng.uniform(20, 80, 14))
    shift = np.column_stack([np.zeros(14), 11 + 0.2 * (np.exp(log_sizes) - 50), np.zeros(14)])
    first, second = (
        MovingDroplets(
            places + some * shift + rng.normal(0, 0.05, (14, 3)),
            np.tile(0.05**2 * np.eye(3), (14, 1, 1)),
            log_sizes + rng.normal(0, 0.01, 14),
        )
        for some in (0, 1)
    )
    own, other = pair(first, second).pairs
    assert len(own) > 11
    np.testing.assert_array_equal(own, other)


@pytest.mark.parametrize("count", [5, 12, 40])
def test_few_droplets_of_two_shots_have_no_partners(count: int) -> None:
    rng = np.random.default_rng(count)
    covariance = np.tile(0.05**2 * np.eye(3), (count, 1, 1))
    for _ in range(20):
        strangers = [
            MovingDroplets(rng.uniform(0, (100, 50, 100), (count, 3)), covariance, np.log(rng.uniform(20, 80, count)))
            for _ in range(2)
        ]
        assert not len(pair(*strangers).pairs[0])
