"""Counting ghosts, and matching what was found with what there is."""

import numpy as np
import pytest

from processing.analysis.droplets.ghost_share import GhostShare, matches, pooled


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
