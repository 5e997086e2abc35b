"""Twins of few droplets: one or two ghosts of a single one are chance, and made good shots of two views doubtful."""

import numpy as np
import pytest

import tomoshadow
from processing.analysis.droplets.droplet_table import SizedDroplets
from processing.analysis.droplets.ghost_share import GhostShare
from processing.analysis.droplets.measured_exposure import MeasuredExposure, ShotVerdict
from processing.analysis.droplets.shadows.seen_shadows import SeenShadows
from processing.analysis.droplets.verdicts.twins import judged_by_twins
from tests.hunt.rig import believed
from tests.hunt.world import HALF_MM, drawn, taken


@pytest.mark.parametrize(
    ("ghosts", "found", "verdict"),
    [(2, 17, "good"), (7, 67, "good"), (4, 14, "doubtful"), (20, 60, "doubtful"), (60, 400, "doubtful")],
)
def test_a_shot_is_doubtful_where_its_twins_surely_have_many_ghosts(ghosts: int, found: int, verdict: str) -> None:
    shot = MeasuredExposure[SizedDroplets, SeenShadows](SizedDroplets.none(), {}, 1.0, ShotVerdict.GOOD)
    assert judged_by_twins(shot, GhostShare(ghosts, found)).verdict == verdict


def test_few_droplets_of_two_views_have_several_twins() -> None:
    world = drawn("two views", 2)
    pictures = taken(world)
    lights = (pictures.shots[0, 0] - pictures.darks) / (pictures.backgrounds - pictures.darks)
    images = {f"view{number}": light.astype(np.float32) for number, light in enumerate(lights, start=1)}
    calibration = believed(world.views, HALF_MM + 0.6)
    grid = tomoshadow.VoxelGrid.centred((144, 156, 204), 1 / 60)
    told = tomoshadow.measure(calibration, images, grid, polarity="shadow", light="gaussian")
    assert told.twins is not None
    assert told.twins.found >= 4 * len(told.droplets)
    assert told.verdict is ShotVerdict.GOOD
