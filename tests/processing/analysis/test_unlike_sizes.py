"""The very same droplets are as large in B as in A; where they are not, diameters of one exposure are wrong."""

from dataclasses import replace

import numpy as np
import pytest

from processing.analysis.droplets.droplet_table import SizedDroplets
from processing.analysis.droplets.measured_exposure import MeasuredExposure, ShotVerdict
from processing.analysis.droplets.shadows.seen_shadows import SeenShadows
from processing.runs.droplets.measured_shot import Exposure, compared, shot_velocities
from processing.runs.shots.separation import Separation
from processing.volume import VoxelGrid

GRID = VoxelGrid((200, 200, 200), (0.0, 0.0, 0.0), 0.02)
US_6 = Separation(6400.0, 0.0, "stated")


def exposures(ratio: float, *, count: int = 80, common: float = 0.0, noise: float = 0.004) -> tuple[Exposure, Exposure]:
    """A and B, the droplets of which have flown 0.1 mm, and look larger by a ratio."""
    rng = np.random.default_rng(3)
    places = rng.uniform(0.3, 3.6, (count, 3))
    true_um = rng.uniform(20, 90, count)
    return (
        seen(places, true_um * np.exp(noise * rng.normal(size=count)), common),
        seen(
            places + (0, 0.1, 0) + rng.normal(0, 1e-4, (count, 3)),
            ratio * true_um * np.exp(noise * rng.normal(size=count)),
            common,
        ),
    )


def seen(places: np.ndarray, diameters_um: np.ndarray, common: float) -> MeasuredExposure[SizedDroplets, SeenShadows]:
    count = len(places)
    ones, covariance = np.ones(count), np.tile(1e-8 * np.eye(3), (count, 1, 1))
    sd_um = np.hypot(0.2, common * diameters_um)
    droplets = SizedDroplets(places, covariance, diameters_um, diameters_um, sd_um, np.full(count, 4), ones, ones)
    return MeasuredExposure(droplets, {}, 1.0, ShotVerdict.GOOD, ())


def judged(pair: tuple[Exposure, Exposure], separation: Separation = US_6) -> tuple[Exposure, ...]:
    velocities, _ = shot_velocities(pair, GRID, separation)
    assert velocities is not None
    assert velocities.pairs > 0.9 * len(pair[0].droplets)
    return compared(pair, velocities)


@pytest.mark.parametrize(("ratio", "word"), [(0.977, "2.3 % smaller"), (0.8, "20.0 % smaller"), (1.05, "5.0 % larger")])
def test_droplets_that_shrink_or_grow_from_a_to_b_are_doubtful(ratio: float, word: str) -> None:
    for exposure in judged(exposures(ratio)):
        assert exposure.verdict is ShotVerdict.DOUBTFUL
        assert word[-7:] in exposure.reasons[0]
        assert float(exposure.reasons[0].split(" are ")[1].split(" %")[0]) == pytest.approx(float(word[:-9]), abs=0.3)


@pytest.mark.parametrize("ratio", [1.0, 0.994, 1.006])
def test_droplets_that_are_as_large_are_good(ratio: float) -> None:
    assert [one.verdict for one in judged(exposures(ratio))] == ["good", "good"]
    assert [one.verdict for one in judged(exposures(ratio, count=12, noise=0.03))] == ["good", "good"]


def test_in_a_light_that_is_known_less_well_more_is_allowed() -> None:
    assert [one.verdict for one in judged(exposures(0.96, common=0.02))] == ["good", "good"]
    assert [one.verdict for one in judged(exposures(0.9, common=0.02))] == ["doubtful", "doubtful"]


def test_nothing_is_said_of_long_times_and_few_droplets() -> None:
    assert judged(exposures(0.9), replace(US_6, mean_ns=2e6))[0].verdict == "good"
    few = exposures(0.9, count=8)
    assert compared(few, shot_velocities(few, GRID, US_6)[0])[0].verdict == "good"
