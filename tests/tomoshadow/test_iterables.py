"""Shots come as whoever calls has them: a generator tells what a list does, and is not empty when it is asked again."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import pytest

import tomoshadow as ts
from processing.analysis.droplets.droplet_file import StoredDroplets
from tests.support.sampled_sprays import cone_shots

DOUBTFUL = '{"verdict": "doubtful", "reasons": ["half have no partner"], "pairs": 60, "stayed": 60}'
SHOTS = [replace(shot, provenance={**shot.provenance, "velocity": DOUBTFUL}) for shot in cone_shots(0, 3, 60)]


def drawn(shots: Iterable[StoredDroplets]) -> object:
    return ts.sizes_figure(shots).axes[0].get_title()


@pytest.mark.parametrize(
    "tell",
    [ts.droplet_statistics, ts.velocity_statistics, ts.spray_statistics, drawn],
    ids=lambda f: f.__name__,
)
def test_a_generator_tells_what_a_list_does(tell: Callable[[Any], object]) -> None:
    assert tell(shot for shot in SHOTS) == tell(SHOTS)


def test_diameters_of_a_generator_are_not_none() -> None:
    told = ts.mean_diameters(shot.columns["diameter_um"] for shot in SHOTS)
    assert (told.n, told.shots) == (sum(len(shot.columns["frame"]) for shot in SHOTS), 3)


def test_droplets_of_two_calibrations_have_no_common_mean() -> None:
    other = replace(SHOTS[1], provenance={**SHOTS[1].provenance, "calibration": "cal-2"})
    for tell in (ts.droplet_statistics, ts.velocity_statistics, ts.spray_statistics):
        with pytest.raises(ts.BadInput, match="calibration cal-2"):
            tell([SHOTS[0], other])
