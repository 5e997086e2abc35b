"""Counting ghosts, and matching what was found with what there is."""

import numpy as np
import pytest

from processing.analysis.droplets.ghost_share import MODEL_SD, GhostShare, expected_share, matches, pooled, told_share
from processing.analysis.estimates import Estimate


def test_pairs_are_one_to_one_closest_first() -> None:
    truth = np.array([[0.0, 0, 0], [1, 0, 0], [5, 0, 0]])
    found = np.array([[0.4, 0, 0], [0.1, 0, 0], [9, 0, 0]])
    of_found, of_truth = matches(found, truth)
    assert of_found.tolist() == [1, 0, -1]
    assert of_truth.tolist() == [1, 0, -1]


def test_nothing_matches_nothing() -> None:
    some, none = np.zeros((2, 3)), np.empty((0, 3))
    assert matches(none, some)[1].tolist() == [-1, -1]
    assert matches(some, none)[0].tolist() == [-1, -1]


def test_intervals_hold_the_true_share_as_often_as_they_say() -> None:
    rng = np.random.default_rng(0)
    held = [
        interval[0] <= 0.03 <= interval[1]
        for ghosts in rng.binomial(400, 0.03, 500)
        if (interval := GhostShare(int(ghosts), 400).interval)
    ]
    assert 0.94 <= np.mean(held) <= 0.99


def test_no_ghost_among_few_droplets_is_not_no_ghost() -> None:
    share = pooled([GhostShare(0, 30), GhostShare(0, 70)])
    assert share == GhostShare(0, 100)
    assert share.interval == pytest.approx((0, 0.0362), abs=1e-3)
    assert (GhostShare(0, 0).share, GhostShare(0, 0).interval) == (None, None)


def test_the_share_is_that_of_the_droplets_of_which_it_is_told() -> None:
    share = told_share(np.array([1.0, 0.9, 0.5, np.nan]), True)
    assert isinstance(share, Estimate)
    assert share.value == pytest.approx(0.2)
    assert (share.low, share.high) == (0, 1)


@pytest.mark.parametrize(
    ("p_real", "why"),
    [
        ([0.9, np.nan, np.nan], "whether droplets are real is unknown of 2 of 3; it was not tried on "),
        ([], "no droplet was measured"),
    ],
)
def test_where_most_probabilities_are_missing_the_reason_is_told(p_real: list[float], why: str) -> None:
    share = told_share(np.array(p_real), True)
    assert isinstance(share, str)
    assert share.startswith(why)


@pytest.mark.parametrize("droplets", [300, 3000, 30000])
def test_intervals_of_expected_ghosts_hold_what_chance_and_wrong_probabilities_make(droplets: int) -> None:
    """Probabilities that are wrong by a factor of their own for each spray."""
    rng, held = np.random.default_rng(1), []
    for wrong in rng.gamma(MODEL_SD**-2, MODEL_SD**2, 400):
        p_ghost = rng.beta(0.1, 2.5, droplets)
        ghosts = np.mean(rng.random(droplets) < wrong * p_ghost)
        share = told_share(1 - p_ghost, True)
        assert isinstance(share, Estimate)
        held.append(share.low <= ghosts <= share.high)
    assert 0.93 <= np.mean(held) <= 0.995


def test_where_all_are_surely_real_no_ghost_is_expected() -> None:
    assert told_share(np.ones(20), True) == Estimate(value=0, low=0, high=0)


def test_of_bright_particles_many_ghosts_are_not_told() -> None:
    few = told_share(np.full(1000, 0.992), False)
    assert few == told_share(np.full(1000, 0.992), True)
    many = told_share(np.full(1000, 0.97), False)
    assert isinstance(many, str)
    assert many.startswith("3.0 % are expected: of bright particles a share above 1 % is not told")


def test_exposures_of_one_shot_make_the_share_no_surer() -> None:
    once = told_share(np.full(200, 0.97), True)
    assert told_share(np.full(400, 0.97), True, 2) == once
    assert told_share(np.full(400, 0.97), True) != once


@pytest.mark.parametrize("ghosts", [0.0, 1e-300, 3e-5, 1e-3, 0.02, 0.3, 4.0])
def test_the_interval_holds_the_share_however_few_ghosts_are_expected(ghosts: float) -> None:
    share = expected_share(ghosts, 66)
    assert share.low <= share.value <= share.high
