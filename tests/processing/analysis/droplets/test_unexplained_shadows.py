"""Shadows that no droplet explains: a view that does not see droplets took them out of shots that were *good*."""

from dataclasses import replace

import numpy as np
import pytest

import tomoshadow
from processing.analysis.droplets.measured_exposure import ShotVerdict
from processing.analysis.droplets.verdicts.unexplained_shadows import unexplained_shadows
from tests.hunt.rig import believed
from tests.hunt.world import HALF_MM, drawn, taken

GRID = tomoshadow.VoxelGrid.centred((144, 156, 204), 1 / 60)
BAND = np.s_[:, 200:228]


@pytest.mark.parametrize(("half_empty", "verdict"), [(True, ShotVerdict.DOUBTFUL), (False, ShotVerdict.GOOD)])
def test_droplets_that_one_of_three_views_does_not_show_are_missed(half_empty: bool, verdict: ShotVerdict) -> None:
    world = replace(drawn("three views", 41002), exposures=1)
    pictures = taken(world)
    lights = (pictures.shots[0, 0] - pictures.darks) / (pictures.backgrounds - pictures.darks)
    if half_empty:
        lights[1][BAND] = np.random.default_rng(0).normal(1, 0.01, lights[1][BAND].shape)
    images = {f"view{number}": light.astype(np.float32) for number, light in enumerate(lights, start=1)}
    calibration = believed(world.views, HALF_MM + 0.6)
    told = tomoshadow.measure(calibration, images, GRID, polarity="shadow", light="gaussian")
    true = int(np.count_nonzero((np.abs(world.clouds[0].places_mm) <= HALF_MM).all(axis=1)))
    assert (len(told.droplets) < 0.9 * true) == half_empty
    assert told.verdict is verdict
    assert any("dark shadows that are of none" in reason for reason in told.reasons) == half_empty


def test_what_is_faint_thin_or_not_asked_is_no_shadow() -> None:
    drawn_light, weight = np.ones((40, 40), np.float32), np.full((40, 40), 1e4, np.float32)
    image = drawn_light.copy()
    image[5:8, 5:8] = 0.5
    image[20:23, 5:8] = 0.8
    image[30, 5:8] = 0.2
    image[5:8, 30:33] = 0.1
    assert unexplained_shadows([image], [drawn_light], [weight]) == [2]
    weight[5:8, 30:33] = 0
    assert unexplained_shadows([image, image], [drawn_light, image], [weight, weight]) == [1, 0]
