"""A weak second flash makes a pale shadow of every droplet, told as a small droplet: such shots are doubtful."""

from dataclasses import replace

import numpy as np

import tomoshadow
from processing.analysis.droplets.bright_shot import BrightExposure
from processing.analysis.droplets.measured_exposure import ShotVerdict
from processing.analysis.droplets.shadows.shadow_shot import ShadowExposure
from tests.hunt.rig import believed
from tests.hunt.world import HALF_MM, drawn, taken

GRID = tomoshadow.VoxelGrid.centred((144, 156, 204), 1 / 60)


def measured(seed: int, share: float) -> tuple[int, BrightExposure | ShadowExposure]:
    """Droplets that there are, and what is told of them where the second flash has a share of the light."""
    world = replace(drawn("some", seed), exposures=2)
    pictures = taken(world)
    seen = (1 - share) * pictures.shots[0, 0] + share * pictures.shots[0, 1]
    lights = np.divide(seen - pictures.darks, pictures.backgrounds - pictures.darks).astype(np.float32)
    images = {f"view{number}": light for number, light in enumerate(lights, start=1)}
    calibration = believed(world.views, HALF_MM + 0.6)
    told = tomoshadow.measure(calibration, images, GRID, polarity="shadow", light="gaussian")
    return len(world.clouds[0].diameters_um), told


def test_pale_shadows_of_a_second_flash_do_not_hide_it() -> None:
    """They fit best below black, and took the veil over the others to two thirds of what it is."""
    true, told = measured(2015, 0.06)
    assert len(told.droplets) > 1.25 * true
    assert told.verdict is ShotVerdict.DOUBTFUL
    assert any("light on twice" in reason for reason in told.reasons)


def test_a_single_flash_is_good() -> None:
    true, told = measured(2015, 0.0)
    assert (len(told.droplets), told.verdict) == (true, ShotVerdict.GOOD)
