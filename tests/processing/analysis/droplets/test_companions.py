"""Droplets that reach into each other: halves of ovals. Those that only stand close, or overlap by chance, are none."""

from dataclasses import replace

import numpy as np
import pytest

import tomoshadow
from processing.analysis.droplets.droplet_table import SizedDroplets
from processing.analysis.droplets.measured_exposure import MeasuredExposure, ShotVerdict
from processing.analysis.droplets.verdicts.companions import judged_by_overlap
from processing.geometry import FloatArray
from tests.hunt.rig import believed
from tests.hunt.world import HALF_MM, World, drawn, taken

GRID = tomoshadow.VoxelGrid.centred((144, 156, 204), 1 / 60)
LARGE_UM = 45.0


@pytest.mark.parametrize(("squeeze", "doubted"), [(0.7, True), (1.0, False)])
def test_large_droplets_that_are_flattened_among_round_ones_are_doubted(squeeze: float, doubted: bool) -> None:
    """In the mean of all, shadows are hardly longer than wide, and two discs explain an oval to the noise."""
    world = drawn("single", 15)
    (cloud,) = world.clouds
    large = cloud.diameters_um > LARGE_UM
    images = _seen(replace(world, clouds=(cloud.kept(~large),))) * _seen(
        replace(world, clouds=(cloud.kept(large),), squeeze=squeeze)
    )
    views = {f"view{number}": image.astype(np.float32) for number, image in enumerate(images, start=1)}
    told = tomoshadow.measure(believed(world.views, HALF_MM + 0.6), views, GRID, polarity="shadow", light="gaussian")
    assert any("reach into each other" in reason for reason in told.reasons) == doubted
    assert (told.verdict is ShotVerdict.GOOD) != doubted


def _seen(world: World) -> FloatArray:
    pictures = taken(world)
    lights: FloatArray = (pictures.shots[0, 0] - pictures.darks) / (pictures.backgrounds - pictures.darks)
    return lights


def test_two_pairs_with_much_of_the_volume_are_needed() -> None:
    pair = np.array([[0, 0, 0], [0, 0.03, 0.0]])
    alone = np.arange(1, 21)[:, None] * [0.2, 0, 0]
    one, two = np.vstack([alone, pair]), np.vstack([alone, pair, pair + [0, 1, 0]])
    assert judged_by_overlap(shot(one, 40)).verdict is ShotVerdict.GOOD
    assert judged_by_overlap(shot(two, 40)).verdict is ShotVerdict.DOUBTFUL
    assert judged_by_overlap(shot(two, 30)).verdict is ShotVerdict.GOOD
    assert judged_by_overlap(shot(two, np.r_[np.full(20, 120.0), np.full(4, 40.0)])).verdict is ShotVerdict.GOOD
    beside = np.r_[np.full(20, 40.0), 60, 30, 60, 30]
    assert judged_by_overlap(shot(two, beside)).verdict is ShotVerdict.GOOD
    assert judged_by_overlap(shot(np.empty((0, 3)), np.empty(0))).verdict is ShotVerdict.GOOD


def shot(points_mm: FloatArray, diameters_um: FloatArray | float) -> MeasuredExposure[SizedDroplets, SizedDroplets]:
    count = len(points_mm)
    sizes, ones = np.broadcast_to(diameters_um, count).astype(float), np.ones(count)
    droplets = SizedDroplets(
        points_mm, np.tile(np.eye(3), (count, 1, 1)), sizes, sizes, ones, np.full(count, 4), ones, ones
    )
    return MeasuredExposure(droplets, {}, 1.0, ShotVerdict.GOOD)
