"""Shots with few droplets are as good as they look only if all of them together say nothing else."""

import json
from dataclasses import asdict
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.droplets.verdicts.elongation import Elongation
from processing.analysis.few_together import few_together
from processing.analysis.spray.spray_doubts import spray_doubts


def shots(
    count: int = 8, droplets: int = 4, *, ratio: float = 1.0, unlike: float = 0.0, separation_ns: float = 6400.0
) -> list[StoredDroplets]:
    """Double exposures whose droplets look larger in B by a ratio, and some unlike round discs."""
    rng = np.random.default_rng(2)
    several = []
    for _ in range(count):
        true_um = rng.uniform(20, 90, droplets)
        seen_um = np.concatenate([true_um, ratio * true_um]) * np.exp(rng.normal(0, 0.004, 2 * droplets))
        partner = np.arange(2 * droplets)
        columns: dict[str, NDArray[Any]] = {
            "frame": np.repeat(np.array(["a", "b"]), droplets),
            "diameter_um": seen_um,
            "diameter_sd_um": np.full(2 * droplets, 0.2),
            "residual": np.where(rng.random(2 * droplets) < unlike, 2.0, 1.0),
            "partner": np.where(partner < droplets, partner + droplets, partner - droplets),
            "p_pair": np.full(2 * droplets, 0.99),
        }
        provenance: dict[str, str | int | float] = {
            "velocity": json.dumps({"separation_ns": separation_ns}),
            "settings": "{}",
            "exposures": json.dumps({frame: {"verdict": "good"} for frame in "ab"}),
        }
        several.append(StoredDroplets(columns, provenance))
    return several


@pytest.mark.parametrize(("ratio", "word"), [(0.95, "smaller in exposure B"), (1.05, "larger in exposure B")])
def test_droplets_that_shrink_or_grow_from_a_to_b_are_told(ratio: float, word: str) -> None:
    assert word in "".join(few_together(shots(ratio=ratio)))


@pytest.mark.parametrize(("along_px2", "told"), [(0.0, ""), (0.12, "longer than wide"), (0.4, "are wrong then")])
def test_few_shadows_of_all_shots_tell_that_they_are_longer_than_wide(along_px2: float, told: str) -> None:
    """In each shot four of them stand alone."""
    several = shots(6)
    for number, shot in enumerate(several):
        noise_px2 = 0.05 * (-1) ** number
        seen = Elongation(along_px2 + noise_px2, noise_px2, 0.07, 3.0, 0.64, 4)
        exposure = {"verdict": "good", "views": {f"view{view}": {"elongation": asdict(seen)} for view in range(1, 5)}}
        shot.provenance["exposures"] = json.dumps(
            {"a": {"verdict": "good", "views": {"view1": {"elongation": None}}}, "b": exposure}
        )
    what = "".join(few_together(several))
    assert told in what
    assert bool(what) is bool(told)


def test_shadows_of_refused_exposures_say_nothing_of_the_others() -> None:
    several = shots(6)
    for shot in several:
        view = {"elongation": asdict(Elongation(0.4, 0.0, 0.07, 3.0, 0.64, 4))}
        exposure = {"verdict": "refused", "views": {f"view{number}": view for number in range(1, 5)}}
        shot.provenance["exposures"] = json.dumps({"a": exposure})
    assert few_together(several) == ()


def test_figures_of_a_spray_are_doubted() -> None:
    assert "smaller in exposure B" in "".join(spray_doubts(shots(ratio=0.95), None, None))


def test_droplets_that_do_not_look_like_discs_are_told() -> None:
    assert "do not look like round opaque discs" in "".join(few_together(shots(unlike=0.3)))


def test_nothing_is_told_of_good_shots_nor_of_many_droplets_nor_of_slow_ones_nor_of_hardly_any() -> None:
    assert not few_together(shots())
    assert not few_together(shots(droplets=40, ratio=0.9, unlike=0.3))
    assert not few_together(shots(ratio=0.9, separation_ns=2e6))
    assert not few_together(shots(2, 2, ratio=0.9, unlike=0.8))
    assert not few_together([])


@pytest.mark.parametrize(("complete_from_um", "told"), [(5.0, False), (12.0, True), (0.0, False)])
def test_small_droplets_that_no_shot_alone_misses_are_told_of_all_shots(complete_from_um: float, told: bool) -> None:
    """Two of five droplets of the spray are below 12 um."""
    several, rng = shots(40), np.random.default_rng(3)
    for shot in several:
        views = {f"view{view}": {"complete_from_um": complete_from_um} for view in range(1, 5)}
        shot.provenance["exposures"] = json.dumps({"a": {"views": views}})
        spray_um = 13.0 * np.exp(0.4 * rng.standard_normal(100))
        shot.columns["diameter_um"][:] = np.tile(spray_um[spray_um > 12.0][:4], 2)
    assert ["all shots together: about" in what for what in few_together(several)] == [True] * told


@pytest.mark.parametrize(("limit", "told"), [(0.2, False), (1.0, True), (0.0, False)])
def test_bright_particles_that_noise_hides_in_each_shot_are_told_of_all_shots(limit: float, told: bool) -> None:
    """A third of the spray is below seven tenths, from where on they are found in noise."""
    several, rng = shots(40), np.random.default_rng(3)
    for shot in several:
        views = {f"view{view}": {"complete_from": limit} for view in range(1, 5)}
        shot.provenance["exposures"] = json.dumps({"a": {"views": views}})
        spray = np.exp(0.5 * rng.standard_normal(100))
        shot.columns["amplitude"] = np.tile(spray[spray > 0.7][:4], 2)
        del shot.columns["diameter_um"]
    assert ["all shots together: about" in what for what in few_together(several)] == [True] * told
