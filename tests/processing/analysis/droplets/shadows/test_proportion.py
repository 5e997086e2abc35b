"""Grey values that are no light, as of sRGB: diameters were a tenth to a fifth wrong, and *good*."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import tests.hunt.world
import tomoshadow
from processing.analysis.droplets.bright_shot import BrightExposure
from processing.analysis.droplets.droplet_table import SizedDroplets
from processing.analysis.droplets.measured_exposure import ShotVerdict
from processing.analysis.droplets.shadows.shadow_shot import ShadowExposure
from tests.hunt.light import behind_blur
from tests.hunt.rig import believed
from tests.hunt.world import HALF_MM, World, drawn, taken

GRID = tomoshadow.VoxelGrid.centred((144, 156, 204), 1 / 60)


def measured(kind: str, seed: int, gamma: float, most: int = 255) -> tuple[float, BrightExposure | ShadowExposure]:
    """Error of the mean diameter over it, and what is told where shots, backgrounds and dark images have a gamma."""
    return measured_of(replace(drawn(kind, seed), exposures=1), gamma, most)


def measured_of(world: World, gamma: float, most: int) -> tuple[float, BrightExposure | ShadowExposure]:
    pictures = taken(world)
    recorded = (pictures.shots[0, 0], pictures.backgrounds, pictures.darks)
    seen, lit, dark = (np.rint(most * np.clip(image, 0, 1) ** gamma) for image in recorded)
    lights = np.divide(seen - dark, lit - dark).astype(np.float32)
    images = {f"view{number}": light for number, light in enumerate(lights, start=1)}
    calibration = believed(world.views, HALF_MM + 0.6)
    told = tomoshadow.measure(calibration, images, GRID, polarity="shadow", light="gaussian")
    assert isinstance(told.droplets, SizedDroplets)
    return float(told.droplets.diameters_um.mean() / world.clouds[0].diameters_um.mean()) - 1, told


@pytest.mark.parametrize(("gamma", "wrong"), [(1 / 2.2, -0.15), (1.4, 0.1)])
def test_a_gamma_is_told_by_how_edges_fall_off(gamma: float, wrong: float) -> None:
    error, told = measured("some", 1, gamma)
    assert error / wrong > 0.9
    assert told.verdict is ShotVerdict.DOUBTFUL
    assert any("in proportion to light" in reason for reason in told.reasons)


@pytest.mark.parametrize(("kind", "seed"), [("some", 1), ("mono", 20), ("three views", 3)])
def test_light_as_it_is_is_good(kind: str, seed: int) -> None:
    error, told = measured(kind, seed, 1.0, 4095)
    assert abs(error) < 0.01
    assert told.verdict is ShotVerdict.GOOD


def test_droplets_hardly_larger_than_their_blur_tell_no_gamma(monkeypatch: pytest.MonkeyPatch) -> None:
    """A blur that is Gaussian from pixel to pixel, and not within them, was told as a power of 1.4."""
    monkeypatch.setattr(tests.hunt.world, "behind_blur", lambda mask, px: gaussian_filter(behind_blur(mask, 0), px))
    world = replace(drawn("some", 2), exposures=1, blurs_px=(0.8,) * 4, noise=0.01)
    cloud = replace(world.clouds[0], diameters_um=np.full(len(world.clouds[0].diameters_um), 24.0))
    error, told = measured_of(replace(world, clouds=(cloud,)), 1.0, 4095)
    assert abs(error) < 0.01
    assert told.verdict is ShotVerdict.GOOD, told.reasons
