"""Droplets that fly in two motions, or three: each finds its partner, or the shot says that some have none."""

import json
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.droplets.measured_exposure import ShotVerdict
from processing.analysis.velocity.measured_velocities import MeasuredVelocities, measure_velocities
from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.analysis.velocity.velocity_statistics import velocity_statistics
from processing.reconstruction.settings import GridSettings
from tests.support.measured_exposures import GRID, PITCH_MM, measured
from tests.support.moving_droplets import BOX, Exposed, exposures, in_both, right

NS = 6400.0
ONE = (10.0, 3.0, -5.0)
MORE = 1_000_000
"""Added to the labels of each further motion."""
Both = tuple[Exposed, Exposed]


def together(scenes: Sequence[Both]) -> Both:
    """All droplets of several double exposures in one."""
    first, second = (_joined([scene[side] for scene in scenes]) for side in (0, 1))
    return first, second


def _joined(several: Sequence[Exposed]) -> Exposed:
    labels = [np.where(one.labels < 0, -1, one.labels + MORE * number) for number, one in enumerate(several)]
    seen = [one.droplets for one in several]
    every = [np.concatenate([getattr(one, name) for one in seen]) for name in ("places", "covariance", "log_sizes")]
    return Exposed(MovingDroplets(*every), np.concatenate(labels))


def within(scene: Both, low: float, high: float) -> Both:
    """Droplets of a part of the box, in both exposures."""
    first, second = (
        one.reordered(np.flatnonzero((one.droplets.places[:, 0] > low) & (one.droplets.places[:, 0] < high)))
        for one in scene
    )
    return first, second


def told(scene: Both, p_ghost: float = 1.0) -> MeasuredVelocities:
    first, second = (measured(one, p_ghost=p_ghost) for one in scene)
    return measure_velocities(first, second, GRID, NS)


def mean_m_s(scene: Both) -> np.ndarray:
    """Of all true droplets that both exposures show."""
    first, second = scene
    _, own, other = np.intersect1d(first.labels, np.where(second.labels < 0, -2, second.labels), return_indices=True)
    ways = second.droplets.places[other] - first.droplets.places[own]
    return np.asarray(ways.mean(axis=0) * PITCH_MM * 1e6 / NS)


@pytest.mark.parametrize(
    "shifts_and_densities",
    [
        (((10, 3, -5), 3.0), ((-3, 10, -5), 2.8)),
        (((10, 3, -5), 6.0), ((-10, -3, 5), 5.5)),
        (((10, 3, -5), 8.0), ((7.2, 7.6, -5), 2.0)),
        (((10, 3, -5), 14.0), ((4, 1.2, -2), 1.5)),
        (((10, 3, -5), 10.0), ((40, 12, -20), 3.0)),
        (((10, 3, -5), 4.0), ((-3, 10, -5), 3.5), ((-5, -1.5, 2.5), 3.0)),
    ],
)
def test_droplets_of_each_motion_find_their_partners(
    shifts_and_densities: Sequence[tuple[tuple[float, float, float], float]],
) -> None:
    scene = together([exposures(seed, one, shift=shift) for seed, (shift, one) in enumerate(shifts_and_densities)])
    found = told(scene)
    own = np.flatnonzero(found.first.paired)
    good = right(*scene, own, found.first.partners.partner[own])
    assert np.count_nonzero(good) > 0.97 * in_both(*scene)
    assert np.mean(good) > 0.995
    assert all("leave the box between A and B more often" in reason for reason in found.reasons)
    np.testing.assert_allclose(np.array(found.mean_m_s), mean_m_s(scene), atol=0.3)


def test_two_streams_beside_each_other_find_theirs() -> None:
    scene = together([within(exposures(1, 3.0), 0, 140), within(exposures(2, 3.0, shift=(-6, -2, 3)), 160, 300)])
    found = told(scene)
    assert found.verdict is ShotVerdict.GOOD
    assert found.pairs > 0.97 * in_both(*scene)
    np.testing.assert_allclose(np.array(found.mean_m_s), mean_m_s(scene), atol=0.3)


def strangers(seed: int, density_per_mm3: float) -> Both:
    """Droplets of A and of B that nothing connects, as those that fly too far."""
    return exposures(seed, density_per_mm3)[0], replace(
        one := exposures(seed + 50, density_per_mm3)[1], labels=one.labels + 10 * MORE
    )


def test_real_droplets_without_a_partner_are_doubted() -> None:
    found = told(together([exposures(1, 14.0), strangers(2, 3.0)]))
    assert found.verdict is ShotVerdict.DOUBTFUL
    assert "% of the surely real droplets that should be in both exposures have no partner" in found.reasons[0]
    assert "in another motion" in found.reasons[0]


def test_droplets_of_which_nothing_tells_whether_they_are_real_are_doubted_where_they_are_more_than_ghosts() -> None:
    for density_per_mm3, verdict in ((1.0, ShotVerdict.GOOD), (6.0, ShotVerdict.DOUBTFUL)):
        first, second = map(measured, together([exposures(1, 14.0), strangers(2, density_per_mm3)]))
        unknown = [replace(one, droplets=one.droplets.unsure()) for one in (first, second)]
        assert measure_velocities(unknown[0], unknown[1], GRID, NS).verdict is verdict


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(
    "scene",
    [
        {"density_per_mm3": 1.0},
        {"density_per_mm3": 4.0, "found": 0.98, "ghosts": 0.15},
        {"density_per_mm3": 14.0, "found": 0.98, "ghosts": 0.15},
        {"density_per_mm3": 7.0, "scatter": 2.0, "ghosts": 0.05},
    ],
)
def test_one_motion_with_ghosts_and_misses_stays_good(seed: int, scene: dict[str, float]) -> None:
    both = exposures(seed, **scene)  # type: ignore[arg-type]
    found = told(both, p_ghost=0.6)
    assert (found.verdict, found.reasons) == (ShotVerdict.GOOD, ())
    own = np.flatnonzero(found.first.paired)
    assert np.mean(right(*both, own, found.first.partners.partner[own])) > 0.99


def test_dirt_among_droplets_that_fly_is_doubted() -> None:
    still, rng = exposures(2, 2.0)[0], np.random.default_rng(3)
    again = still.placed(still.droplets.places + rng.normal(0, 0.04, still.droplets.places.shape))
    scene = together([exposures(1, 10.0), (still, again)])
    dirt = scene[0].labels >= MORE
    found = told(scene)
    assert found.verdict is ShotVerdict.DOUBTFUL
    share = np.mean(dirt[found.first.paired])
    assert f"{100 * share:.0f} % of the droplets stand still" in found.reasons[0]


def test_droplets_of_a_second_motion_that_leave_the_box_are_not_missed() -> None:
    scene = together([exposures(1, 14.0), exposures(2, 10.0, shift=(0.0, 24.0, 0.0))])
    found = told(scene)
    (reason,) = found.reasons
    assert "leave the box between A and B more often" in reason
    assert found.share_paired is not None
    assert found.share_paired > 0.98
    leaving = scene[0].droplets.places[:, 1] > BOX[1] - 20
    assert np.mean(found.first.paired[leaving]) < 0.75


def stored(scene: Both) -> StoredDroplets:
    """The shot as its file has it."""
    first, second = (measured(one, p_ghost=0.6) for one in scene)
    found = measure_velocities(first, second, GRID, NS)
    tables = found.columns()
    sides = [{**one.droplets.columns(), **tables[frame]} for one, frame in ((first, "a"), (second, "b"))]
    columns = {name: np.concatenate([side[name] for side in sides]) for name in sides[0]}
    columns["frame"] = np.repeat(["a", "b"], [len(one.droplets) for one in (first, second)])
    told = {"verdict": found.verdict, "reasons": found.reasons, "pairs": found.pairs, "stayed": found.stayed}
    grid = GridSettings.of(GRID).model_dump_json()
    return StoredDroplets(columns, {"velocity": json.dumps(told), "grid": grid, "settings": "{}"})


def test_shots_tell_together_what_each_has_too_few_droplets_for() -> None:
    shots = [stored(together([exposures(seed, 0.9), strangers(seed + 20, 0.15)])) for seed in range(8)]
    alone = [json.loads(str(shot.provenance["velocity"]))["verdict"] for shot in shots]
    assert alone.count("good") > 4
    doubts = velocity_statistics(shots).doubts
    assert any("surely real droplets that should be in both exposures have no partner" in one for one in doubts)


def test_good_shots_are_not_doubted_together() -> None:
    shots = [stored(exposures(seed, 0.9, found=0.98, ghosts=0.15)) for seed in range(8)]
    assert velocity_statistics(shots).doubts == ()
