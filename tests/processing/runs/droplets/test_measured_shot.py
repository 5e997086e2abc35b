"""What is told of a shot is told of both exposures together."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from processing.analysis.droplets.droplet_table import SizedDroplets
from processing.analysis.droplets.measured_exposure import MeasuredExposure, ShotVerdict
from processing.analysis.droplets.shadows.seen_shadows import SeenShadows
from processing.analysis.hidden import Hidden
from processing.runs.droplets.measured_shot import shot_summary, shot_velocities
from processing.runs.shots.separation import Separation
from processing.volume import VoxelGrid


def exposure(
    count: int, verdict: ShotVerdict = ShotVerdict.GOOD, *reasons: str
) -> MeasuredExposure[SizedDroplets, SeenShadows]:
    """Droplets of which nobody knows whether they are real."""
    numbers = np.ones(count)
    unknown = np.full(count, np.nan)
    points, covariance = np.zeros((count, 3)), np.zeros((count, 3, 3))
    views = np.full(count, 4)
    droplets = SizedDroplets(points, covariance, numbers, numbers, numbers, views, numbers, unknown)
    return MeasuredExposure(droplets, {}, 1.0, verdict, reasons)


def reason(*exposures: MeasuredExposure[SizedDroplets, SeenShadows]) -> str:
    return shot_summary(0, exposures, "one exposure", 0.0, Path("shot.h5")).ghost_reason or ""


def test_why_there_is_no_share_of_ghosts_is_told_once() -> None:
    told = "whether droplets are real is unknown of 278 of 278; "
    assert reason(exposure(145), exposure(133)).startswith(told)
    assert reason(exposure(145), exposure(133)).count("whether droplets are real") == 1


def test_beside_ligaments_they_are_the_reason_in_one_sentence() -> None:
    beside = [replace(exposure(count), hidden=Hidden(liquid_objects=15)) for count in (145, 133)]
    told = "whether droplets are real is unknown of 278 of 278; it was not tried "
    assert reason(*beside) == f"{told}beside more ligaments and the like than 1 % of the droplets"
    assert reason(beside[0], exposure(133)).startswith(f"{told}on droplets like the others")


def test_of_a_doubtful_exposure_the_doubt_is_the_reason() -> None:
    told = reason(exposure(145), exposure(133, ShotVerdict.DOUBTFUL, "it is blurred"))
    assert told.endswith("; it is blurred")


def test_whoever_doubts_an_exposure_no_droplet_of_it_is_told_to_be_real() -> None:
    """Its calibration, or exposure B, are asked once all is measured."""
    good = exposure(3)
    good = replace(good, droplets=replace(good.droplets, p_real=np.full(3, 0.9)))
    doubted = good.doubted(("another scale",))
    assert (doubted.verdict, good.doubted(()).verdict) == (ShotVerdict.DOUBTFUL, ShotVerdict.GOOD)
    assert np.isnan(doubted.droplets.p_real).all()
    assert not np.isnan(good.doubted(()).droplets.p_real).any()
    assert doubted.doubted(("first",), before=True).reasons == ("first", "another scale")


def flown(way_mm: tuple[float, float, float]) -> tuple[str, str]:
    """Verdict and reasons of droplets that have flown, of a spray that is stated to leave along y."""
    rng, count = np.random.default_rng(5), 80
    places, scatter = rng.uniform(0.5, 3.4, (count, 3)), rng.normal(0, 2e-4, (count, 3))
    pair = [replace(exposure(count), droplets=placed(points)) for points in (places, places + way_mm + scatter)]
    grid = VoxelGrid((200, 200, 200), (0.0, 0.0, 0.0), 0.02)
    _, told = shot_velocities(pair, grid, Separation(6400.0, 0.0, "stated"), (0.0, 2.0, 0.0))
    assert not isinstance(told, str)
    return told.verdict, " ".join(told.reasons)


def placed(points_mm: np.ndarray) -> SizedDroplets:
    count = len(points_mm)
    ones, covariance = np.ones(count), np.tile(1e-8 * np.eye(3), (count, 1, 1))
    return SizedDroplets(points_mm, covariance, 40 * ones, 40 * ones, ones, np.full(count, 4), ones, ones)


@pytest.mark.parametrize("way_mm", [(0.0, -0.1, 0.0), (0.04, -0.1, 0.03)])
def test_droplets_that_fly_to_the_nozzle_are_doubtful(way_mm: tuple[float, float, float]) -> None:
    """All images upside down, or A and B exchanged, explain everything as well."""
    verdict, reasons = flown(way_mm)
    assert verdict == "doubtful"
    assert "against the stated axis of the spray: are images upside down, or exposures A and B exchanged?" in reasons


@pytest.mark.parametrize("way_mm", [(0.0, 0.1, 0.0), (0.1, -0.02, 0.0)])
def test_droplets_that_fly_along_the_spray_or_across_are_good(way_mm: tuple[float, float, float]) -> None:
    assert flown(way_mm) == ("good", "")
