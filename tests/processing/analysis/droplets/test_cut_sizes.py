"""Sprays that are cut by what can be seen, against the share that is really missing."""

import numpy as np
import pytest

from processing.analysis.droplets.verdicts.cut_sizes import AMPLITUDES, cut_off
from processing.geometry import FloatArray

LIMIT_UM = 12.0


def told(median_um: float, spread: float, count: int, seed: int) -> str:
    diameters_um = median_um * np.exp(spread * np.random.default_rng(seed).standard_normal(count))
    return cut_off(diameters_um[diameters_um > LIMIT_UM], LIMIT_UM)


@pytest.mark.parametrize(("median_um", "spread", "missing"), [(14.0, 0.35, 33), (12.0, 0.4, 50), (16.0, 0.5, 28)])
def test_the_share_that_is_missing_is_told(median_um: float, spread: float, missing: int) -> None:
    shares = [int(told(median_um, spread, 1500, seed).split("%")[0].split()[-1]) for seed in range(10)]
    assert np.mean(shares) == pytest.approx(missing, abs=6)


@pytest.mark.parametrize("count", [20, 50, 100, 1000])
@pytest.mark.parametrize(
    ("median_um", "spread"), [(25.0, 0.35), (30.0, 0.4), (40.0, 0.5), (17.0, 0.1), (20.0, 0.2), (60.0, 0.7)]
)
def test_a_distribution_that_ends_above_the_limit_is_not_doubted(median_um: float, spread: float, count: int) -> None:
    """At most 2 % of these are smaller: in 50 sprays each hardly one is called cut."""
    assert sum(bool(told(median_um, spread, count, seed)) for seed in range(50)) <= 2


@pytest.mark.parametrize("count", [50, 150, 1000])
def test_what_is_found_below_the_limit_is_not_missing(count: int) -> None:
    """The limit is that of a droplet out of focus: in focus smaller ones are found."""
    sprays = [18.5 * np.exp(0.4 * np.random.default_rng(seed).standard_normal(count)) for seed in range(50)]
    below = np.mean([np.mean(spray < LIMIT_UM) for spray in sprays])
    assert below == pytest.approx(0.14, abs=0.01)
    assert sum(bool(cut_off(spray, LIMIT_UM)) for spray in sprays) <= 2


def test_of_what_is_below_the_limit_only_the_part_that_is_not_found_is_missing() -> None:
    sprays = [12.0 * np.exp(0.4 * np.random.default_rng(seed).standard_normal(20000)) for seed in range(10)]
    found = [spray[(spray > LIMIT_UM) | (np.arange(20000) % 2 == 0)] for spray in sprays]
    shares = [int(cut_off(some, LIMIT_UM).split("%")[0].split()[-1]) for some in found]
    assert np.mean(shares) == pytest.approx(25, abs=6)


def test_two_sizes_of_which_none_is_near_the_limit_are_whole() -> None:
    two = np.random.default_rng(0).normal([18.0, 80.0], [1.0, 5.0], (200, 2)).ravel()
    assert cut_off(two, LIMIT_UM) == ""


def seen_in_noise(median: float, spread: float, count: int, seed: int) -> tuple[FloatArray, float]:
    """Amplitudes that are told of bright particles, over the limit, and the share that is not; 10 % of it is noise."""
    rng = np.random.default_rng(seed)
    seen = median * np.exp(spread * rng.standard_normal(count)) + 0.1 * rng.standard_normal(count)
    is_told = (seen > 0.5) & (seen + 0.1 * rng.standard_normal(count) > 0.6)
    return seen[is_told], float(np.mean(~is_told))


@pytest.mark.parametrize(("median", "spread", "missing"), [(1.0, 0.5, 17), (0.8, 0.4, 26), (1.2, 0.7, 18)])
def test_the_share_of_bright_particles_that_noise_hides_is_told(median: float, spread: float, missing: int) -> None:
    seen = [seen_in_noise(median, spread, 1000, seed) for seed in range(10)]
    assert 100 * np.mean([share for _, share in seen]) == pytest.approx(missing, abs=2)
    shares = [int(cut_off(some, 1.0, AMPLITUDES).split("%")[0].split()[-1]) for some, _ in seen]
    assert np.mean(shares) == pytest.approx(missing, abs=6)


@pytest.mark.parametrize("count", [20, 60, 300])
@pytest.mark.parametrize(("median", "spread"), [(2.0, 0.3), (3.0, 0.5), (5.0, 0.7), (1.5, 0.05), (20.0, 1.0)])
def test_bright_particles_that_are_seen_in_the_noise_are_not_doubted(median: float, spread: float, count: int) -> None:
    seen = [seen_in_noise(median, spread, count, seed)[0] for seed in range(50)]
    assert sum(bool(cut_off(some, 1.0, AMPLITUDES)) for some in seen) <= 1


def test_two_classes_of_bright_particles_in_the_noise_are_whole() -> None:
    two = np.random.default_rng(0).normal([1.4, 7.0], [0.1, 0.3], (200, 2)).ravel()
    assert cut_off(two, 1.0, AMPLITUDES) == ""


def test_nothing_is_said_of_few_or_where_nobody_knows_the_limit() -> None:
    assert cut_off(np.full(9, 12.5), LIMIT_UM) == ""
    assert cut_off(np.linspace(12.0, 20.0, 300), np.zeros(300)) == ""
