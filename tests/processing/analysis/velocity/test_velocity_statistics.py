"""Mean velocities of shots, and how sure they are."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from processing.analysis.droplets.droplet_file import DropletFileError, StoredDroplets
from processing.analysis.velocity.velocity_statistics import velocity_statistics
from processing.reconstruction.settings import GridSettings
from processing.volume import VoxelGrid


def shot(velocities_m_s: np.ndarray, stayed: int | None = None) -> StoredDroplets:
    """Pairs with these velocities, in both exposures, and one droplet of A without a partner."""
    pairs = len(velocities_m_s)
    both = np.vstack([velocities_m_s, [[np.nan] * 3], velocities_m_s])
    columns: dict[str, Any] = {"frame": np.repeat(["a", "b"], [pairs + 1, pairs])}
    columns |= {f"{name}_m_s": both[:, axis] for axis, name in enumerate("uvw")}
    told = {"verdict": "good", "reasons": [], "pairs": pairs, "stayed": stayed or pairs}
    return StoredDroplets(columns, {"velocity": json.dumps(told)})


def without(reason: str) -> StoredDroplets:
    return StoredDroplets({"frame": np.array(["a"])}, {"velocity": json.dumps({"reason": reason})})


def drawn(rng: np.random.Generator, pairs: int, of_shot: float = 0.0) -> np.ndarray:
    return rng.normal((10, -5, 2), 2.0, (pairs, 3)) + rng.normal(0, of_shot, 3)


def test_every_pair_counts_once() -> None:
    rng = np.random.default_rng(1)
    rows = [drawn(rng, 40), drawn(rng, 10)]
    statistics = velocity_statistics([shot(rows[0], 50), shot(rows[1], 10)])
    assert (statistics.shots, statistics.pairs) == (2, 50)
    assert statistics.mean_m_s is not None
    assert statistics.mean_m_s.u.value == pytest.approx(np.concatenate(rows)[:, 0].mean())
    assert statistics.share_paired is not None
    assert statistics.share_paired.value == pytest.approx(50 / 60)
    assert statistics.share_paired.low < 50 / 60 < statistics.share_paired.high
    assert (statistics.intervals_over, statistics.reason) == ("shots", None)


@pytest.mark.parametrize(("shots", "of_shot"), [(1, 0.0), (5, 0.0), (5, 2.0)])
def test_the_interval_holds_the_truth_as_often_as_it_says(shots: int, of_shot: float) -> None:
    rng = np.random.default_rng(2)
    held = []
    for _ in range(300):
        mean = velocity_statistics([shot(drawn(rng, 30, of_shot)) for _ in range(shots)]).mean_m_s
        assert mean is not None
        held += [one.low < true < one.high for one, true in zip((mean.u, mean.v, mean.w), (10, -5, 2), strict=True)]
    assert np.mean(held) == pytest.approx(0.95, abs=0.03)


def test_shots_that_happen_to_be_alike_are_no_surer_than_their_pairs() -> None:
    rows = drawn(np.random.default_rng(5), 40)
    alike = velocity_statistics([shot(rows), shot(rows)]).mean_m_s
    together = velocity_statistics([shot(np.tile(rows, (2, 1)))]).mean_m_s
    assert alike is not None
    assert alike == together


def test_a_single_pair_does_not_tell_how_velocities_differ() -> None:
    statistics = velocity_statistics([shot(np.array([[1.0, 2.0, 3.0]]))])
    assert (statistics.pairs, statistics.mean_m_s) == (1, None)
    assert "a single pair" in (statistics.reason or "")


@pytest.mark.parametrize("others", [{}, {"settings": '{"light": "gaussian"}'}])
def test_a_shot_that_is_there_twice_is_refused(others: dict[str, Any]) -> None:
    """Found twice by a pattern, it would make the mean as sure as one may wish."""
    one = shot(drawn(np.random.default_rng(4), 40))
    twice = [replace(one, provenance={**one.provenance, "run": "spray", "shot": 3, **told}) for told in ({}, others)]
    with pytest.raises(DropletFileError, match="run spray, shot 3: its droplets are there 2 times"):
        velocity_statistics(twice)


def test_without_velocities_every_reason_is_told_once() -> None:
    refused = StoredDroplets(
        {"frame": np.array(["a"])}, {"velocity": json.dumps({"reasons": ["no motion"], "pairs": 0, "stayed": 0})}
    )
    old = StoredDroplets({"frame": np.array(["a"])}, {})
    statistics = velocity_statistics([without("one exposure"), without("one exposure"), refused, old])
    assert (statistics.shots, statistics.pairs, statistics.mean_m_s) == (0, 0, None)
    assert statistics.reason is not None
    assert statistics.reason.startswith("one exposure; no motion; a file does not tell velocities")


def test_shots_without_velocities_do_not_count() -> None:
    statistics = velocity_statistics([without("one exposure"), shot(drawn(np.random.default_rng(3), 20))])
    assert (statistics.shots, statistics.pairs, statistics.intervals_over) == (1, 20, "pairs")


@pytest.mark.parametrize(("rows", "doubted"), [(60, True), (600, False)])
def test_shots_together_tell_that_fast_droplets_leave_the_box(rows: int, doubted: bool) -> None:
    rng = np.random.default_rng(6)
    grid = VoxelGrid((200, rows, 300), (0.0, 0.0, 0.0), 1 / 60)
    told = []
    for _ in range(6):
        way = rng.uniform(2, 25, 40)
        stays = rng.random(40) < 1 - way / rows
        one = shot(np.where(stays[:, None], np.outer(way, [0, 2.6, 0]), np.nan))
        its = json.loads(str(one.provenance["velocity"])) | {"separation_ns": 6400.0}
        grids = {"velocity": json.dumps(its), "grid": GridSettings.of(grid).model_dump_json()}
        told.append(replace(one, provenance={**one.provenance, **grids}))
    doubts = velocity_statistics(told).doubts
    assert any("leave the box between A and B more often" in doubt for doubt in doubts) == doubted
