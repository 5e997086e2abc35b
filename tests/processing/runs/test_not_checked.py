"""What nothing checks is asked of files alone: of what they say, and of older ones that say nothing."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.runs.not_checked import KNOWN, KnownImages, not_checked
from processing.runs.unchecked_images import CROPPED, DEPTH, LENGTHS, MOVED, ORDER
from tests.support.sampled_sprays import stored_shot

OF_A_RIG = {"lengths": True, "depth": True, "whole": True}
DOUBLE = {frame: {"verdict": "good", "reasons": []} for frame in "ab"}


def shot(known: dict[str, bool] | None, **told: Any) -> StoredDroplets:
    of_images: dict[str, Any] = {} if known is None else {KNOWN: KnownImages.model_validate(known).model_dump_json()}
    return stored_shot(np.full(20, 40.0), **of_images, **told)


@pytest.mark.parametrize(
    ("known", "told"),
    [
        (OF_A_RIG, {MOVED}),
        ({**OF_A_RIG, "lengths": False}, {MOVED, LENGTHS}),
        ({**OF_A_RIG, "depth": False}, {MOVED, DEPTH}),
        ({**OF_A_RIG, "whole": False}, {CROPPED}),
        (None, {MOVED, CROPPED, LENGTHS, DEPTH}),
    ],
)
def test_what_was_known_when_a_shot_was_measured_is_not_told(known: dict[str, bool] | None, told: set[object]) -> None:
    unchecked = not_checked([shot(known)], directed=True)
    assert {MOVED, CROPPED, LENGTHS, DEPTH}.intersection(unchecked) == told


def test_of_shots_of_several_runs_what_is_not_known_of_one_is_told_once() -> None:
    known, unknown = shot(OF_A_RIG), shot({**OF_A_RIG, "lengths": False})
    unchecked = not_checked([known, unknown, known, unknown], directed=True)
    assert unchecked.count(LENGTHS) == unchecked.count(MOVED) == 1
    assert DEPTH not in unchecked


@pytest.mark.parametrize("known", [OF_A_RIG, None])
def test_diameters_that_a_reticle_corrects_name_what_nothing_tells_of_it(known: dict[str, bool] | None) -> None:
    """Dots whose images had a gamma of 0.85 made D10 of right images 5 % too large, and nothing said so.

    Those that a scale 5 % off makes larger correct diameters: velocities of the same shots were 5 % too large.
    """
    by_dots = json.dumps({"polarity": "shadow", "light": "gaussian", "sizes": [[63, 60, 1], [126, 120, 1]]})
    told = not_checked([shot(known, settings=by_dots)], directed=True)
    assert [one for one in told if "whether the reticle of --sizes" in one.what]
    assert (LENGTHS in told) == (known is None)
    assert not [one for one in not_checked([shot(known)], directed=True) if "reticle of --sizes" in one.what]


def test_of_double_exposures_who_says_where_the_liquid_comes_from_and_the_separation_is_asked() -> None:
    double = shot(OF_A_RIG, exposures=json.dumps(DOUBLE))
    assert ORDER in not_checked([double], directed=False)
    assert ORDER not in not_checked([double], directed=True)
    assert ORDER not in not_checked([shot(OF_A_RIG)], directed=False)
    stated = {"verdict": "good", "pairs": 0, "separation_source": "stated", "share_alone": None}
    shots = [
        replace(double, provenance={**double.provenance, "velocity": json.dumps({**stated, "separation_ns": ns})})
        for ns in (6400, 6400, 9000)
    ]
    told = [one.what for one in not_checked(shots, directed=True) if "exposure B comes" in one.what]
    assert [("6400 ns" in one, "9000 ns" in one) for one in told] == [(True, False), (False, True)]
