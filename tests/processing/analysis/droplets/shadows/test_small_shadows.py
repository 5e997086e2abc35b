"""Few droplets that are hardly larger than the blur: it explains much of what their diameters do, and of black, too."""

from dataclasses import replace

import numpy as np
import pytest

import tomoshadow
from processing.analysis.droplets.droplet_table import SizedDroplets
from processing.analysis.droplets.measured_exposure import ShotVerdict
from processing.geometry import FloatArray
from tests.hunt.rig import believed
from tests.hunt.world import HALF_MM, World, drawn, taken

GRID = tomoshadow.VoxelGrid.centred((144, 156, 204), 1 / 60)


def small(seed: int, size_um: float) -> World:
    """Droplets of about that diameter."""
    world = replace(drawn("single", seed), noise=0.0131, bits=12)
    (cloud,) = world.clouds
    scatter = np.exp(0.1 * np.random.default_rng(seed).standard_normal(len(cloud.diameters_um)))
    return replace(world, clouds=(replace(cloud, diameters_um=size_um * scatter),))


def measured_um(world: World) -> tuple[FloatArray, ShotVerdict, tuple[str, ...]]:
    pictures = taken(world)
    lights = (pictures.shots[0, 0] - pictures.darks) / (pictures.backgrounds - pictures.darks)
    images = {f"view{number}": light.astype(np.float32) for number, light in enumerate(lights, start=1)}
    calibration = believed(world.views, HALF_MM + 0.6)
    told = tomoshadow.measure(calibration, images, GRID, polarity="shadow", light="gaussian")
    assert isinstance(told.droplets, SizedDroplets)
    return told.droplets.diameters_um, told.verdict, told.reasons


@pytest.mark.parametrize(
    "world",
    [small(903, 17), small(901, 20), drawn("two views", 45)],
    ids=["17 um", "20 um", "eleven in two views"],
)
def test_they_are_as_large_as_they_are_and_black_is_black(world: World) -> None:
    """Blur and diameters must be at rest together: the images as a whole hardly tell that they are not."""
    diameters_um, verdict, reasons = measured_um(world)
    (cloud,) = world.clouds
    assert diameters_um.mean() == pytest.approx(cloud.diameters_um.mean(), rel=0.01)
    assert (verdict, reasons) == (ShotVerdict.GOOD, ())
