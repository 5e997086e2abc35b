"""Shots of few droplets tell together whether near is taken for far, or that nothing tells it."""

import json
from collections.abc import Mapping

import numpy as np
import pytest

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.near_or_far import AS_SEEN, SIGHTS, depth_doubts, depth_known, depth_reversed, sights_of
from processing.runs.unchecked_images import DEPTH, SPARSE, unchecked_images

MIRRORED = "all images are mirrored"


def shot(counts: Mapping[str, int] | None) -> StoredDroplets:
    return StoredDroplets({"frame": np.empty(0)}, {} if counts is None else {SIGHTS: json.dumps(counts)})


def counts(as_seen: int, mirrored: int) -> dict[str, int]:
    return {AS_SEEN: as_seen, MIRRORED: mirrored, "views are exchanged": 0}


def test_what_no_shot_tells_for_sure_all_of_them_do() -> None:
    sparse = counts(7, 18)
    assert not depth_reversed(sparse)
    assert depth_doubts([shot(sparse)] * 2) == ()
    (doubt,) = depth_doubts([shot(sparse)] * 6)
    assert doubt == (
        "all shots together: all views agree on 42 droplets within 0.25 px, and on 108 if all images are mirrored: "
        "depth is reversed"
    )


@pytest.mark.parametrize("number", [1, 6])
def test_shots_that_are_fine_are_not_doubted(number: int) -> None:
    shots = [shot(counts(18, 7))] * number
    assert depth_doubts(shots) == ()
    assert depth_known(sights_of(shots)) == (number == 6)


def test_shots_from_before_and_those_without_droplets_tell_nothing() -> None:
    shots = [shot(None), shot({}), shot(counts(0, 0))]
    assert depth_doubts(shots) == ()
    assert not depth_known(sights_of(shots))
    assert not depth_known(sights_of(shots[:2]))


def test_what_droplets_are_too_few_for_is_not_checked() -> None:
    assert SPARSE in unchecked_images("bright", sparse=True)
    told = list(unchecked_images("bright", shallow=True, sparse=True))
    assert (DEPTH in told, SPARSE in told) == (True, False)
    assert SPARSE not in unchecked_images("bright")
