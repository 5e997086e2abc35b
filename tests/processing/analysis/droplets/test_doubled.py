"""Droplets that are there twice, and such as lie close together, in rows or in clusters without being copies."""

from dataclasses import replace

import numpy as np
import pytest

from processing.analysis.droplets.bright_shot import measure_bright
from processing.analysis.droplets.droplet_table import Droplets
from processing.analysis.droplets.measured_exposure import MeasuredExposure, ShotVerdict
from processing.analysis.droplets.shadows.shadow_shot import measure_shadows
from processing.analysis.droplets.verdicts.doubled import judged_by_copies
from processing.geometry import FloatArray
from processing.studies.droplets import DropletCase, bright_images
from processing.volume import VoxelGrid
from tests.support import shadow_scenes
from tests.support.bright_scenes import GRID, MARGIN_VOXEL, scene, search_of
from tests.support.shadow_scenes import BLURS_PX, scale_px_per_mm, shadow_scene, united_shadow

WAY_MM = np.array([8.0, 3.0, 2.0]) * GRID.pitch_mm
BOX = VoxelGrid.centred((300, 300, 300), GRID.pitch_mm)


@pytest.mark.parametrize("share", [1.0, 0.4])
def test_two_flashes_in_one_exposure_of_bright_particles_are_doubted(share: float) -> None:
    """Every particle is told twice, surely, and nothing is left of the images."""
    truth = scene(DropletCase(14))
    again = bright_images(
        DropletCase(14, noise_percent=0), truth.believed, truth.points_mm + WAY_MM, share * truth.heights, rng()
    )
    told = measure_bright([one + other for one, other in zip(truth.images, again, strict=True)], search_of(truth))
    assert len(told.droplets) > 1.5 * len(truth.points_mm)
    assert told.residual_over_noise == pytest.approx(1, abs=0.05)
    assert told.verdict is ShotVerdict.DOUBTFUL
    assert "are there again 0.13, 0.05, 0.03 mm away" in told.reasons[-1]


def test_shadows_that_are_there_twice_are_doubted() -> None:
    truth, size_px = shadow_scene((80, 40, 160), 7, (240, 100)), (240, 100)
    places_mm, diameters_mm = np.vstack([truth.points_mm, truth.points_mm + WAY_MM]), np.tile(truth.diameters_mm, 2)
    images = [
        united_shadow(
            camera.project(places_mm), 0.5 * diameters_mm * scale_px_per_mm(camera, places_mm), blur_px, size_px
        )
        for camera, blur_px in zip(truth.cameras, BLURS_PX, strict=True)
    ]
    noisy = [(image + rng().normal(0, 0.012, image.shape)).astype(np.float32) for image in images]
    told = measure_shadows(noisy, shadow_scenes.search_of(truth, MARGIN_VOXEL), light="gaussian")
    assert len(told.droplets) > 1.4 * len(truth.points_mm)
    assert told.verdict is ShotVerdict.DOUBTFUL
    assert "are there again" in " ".join(told.reasons)


def rng(seed: int = 5) -> np.random.Generator:
    return np.random.default_rng(seed)


def good(places_voxel: FloatArray, heights: FloatArray | None = None) -> MeasuredExposure[Droplets, Droplets]:
    few = scene()
    count = len(places_voxel)
    droplets = replace(
        Droplets.none(),
        points_mm=places_voxel * BOX.pitch_mm,
        covariance_mm2=np.zeros((count, 3, 3)),
        amplitudes=np.ones(count) if heights is None else heights,
        **{name: np.ones(count) for name in ("amplitude_sd", "residual", "p_real")},
        views=np.full(count, len(few.believed)),
    )
    return MeasuredExposure(droplets, {}, 1.0, ShotVerdict.GOOD)


def anywhere(count: int, seed: int = 5) -> FloatArray:
    return np.asarray(rng(seed).uniform(0, 300, (count, 3)))


@pytest.mark.parametrize("count", [1, 2, 7, 40, 300])
@pytest.mark.parametrize("seed", range(3))
def test_droplets_anywhere_are_no_copies(count: int, seed: int) -> None:
    assert judged_by_copies(good(anywhere(count, seed)), BOX).verdict is ShotVerdict.GOOD


CLUSTERS = anywhere(8)[rng().integers(0, 8, 300)] + rng(6).normal(0, 6, (300, 3))
CHAIN = np.arange(40)[:, None] * [0, 15.0, 0] + rng().normal(0, 0.5, (40, 3))
JET = rng().normal(0, 1, (300, 3)) * [8, 150, 8]
TWO_JETS = np.vstack([JET, JET[::-1] * [1, -1, 1] + [60, 0, 0]])
TWO_CLUSTERS = rng(8).normal(0, 6, (40, 3)) + np.repeat([[0, 0, 0], [20, 150, 90]], 20, axis=0)
BROKEN_IN_TWO = np.vstack([anywhere(150), anywhere(150) + rng(7).normal(0, 8, (150, 3))])


@pytest.mark.parametrize(
    "places_voxel",
    [np.empty((0, 3)), CLUSTERS, TWO_CLUSTERS, CHAIN, JET, TWO_JETS, BROKEN_IN_TWO],
    ids=["none", "clusters", "two clusters", "chain", "jet", "two jets", "broken in two"],
)
def test_sprays_that_are_not_even_are_no_copies(places_voxel: FloatArray) -> None:
    assert judged_by_copies(good(places_voxel), BOX).verdict is ShotVerdict.GOOD


@pytest.mark.parametrize("count", [8, 40, 400])
@pytest.mark.parametrize("way_voxel", [(8, 0, 0), (0, -30, 5), (0, 0, 60)])
def test_copies_among_others_are_told(count: int, way_voxel: tuple[float, float, float]) -> None:
    """That fly 1 voxel faster or slower; a quarter is by itself."""
    places = anywhere(count)
    copies = (places + way_voxel + rng(6).normal(0, 1, places.shape))[: round(0.75 * count)]
    told = judged_by_copies(good(np.vstack([places, copies])), BOX)
    assert (told.verdict, len(told.reasons)) == (ShotVerdict.DOUBTFUL, 1)


@pytest.mark.parametrize("count", [40, 150, 400])
@pytest.mark.parametrize("seed", range(1))
def test_few_copies_are_told_where_all_are_fainter(count: int, seed: int) -> None:
    """As those of a second flash so weak that it shows the largest droplets alone."""
    places, heights = anywhere(count, seed), rng(seed).lognormal(0, 0.4, count)
    large = np.argsort(-heights)[: max(7, round(0.15 * count))]
    copies = places[large] + [2, 9, -1] + rng(6).normal(0, 1, (len(large), 3))
    both = np.vstack([places, copies]), np.concatenate([heights, 0.2 * heights[large]])
    assert judged_by_copies(good(*both), BOX).verdict is ShotVerdict.DOUBTFUL


@pytest.mark.parametrize("seed", range(4))
def test_copies_of_the_large_ones_are_told_beside_a_pair_that_is_none(seed: int) -> None:
    """Nine of 42 droplets are large, and a weak flash shows eight of them once more; two others are as far apart."""
    places, heights = anywhere(42, seed), rng(seed).normal(28, 2, 42)
    heights[:9] = rng(seed).normal(75, 4, 9)
    places[20] = places[21] + [2.5, 9, -1]
    copies = places[:8] + [2.3, 8.9, -1.7] + rng(seed + 6).normal(0, 0.7, (8, 3))
    both = np.vstack([places, copies]), np.concatenate([heights, heights[:8] / 6.3])
    told = judged_by_copies(good(*both), BOX)
    assert told.verdict is ShotVerdict.DOUBTFUL
    assert "8 of 50 droplets are there again" in told.reasons[0]


@pytest.mark.parametrize("seed", range(4))
def test_five_copies_that_are_fainter_by_the_same_factor_are_told(seed: int) -> None:
    places, heights = anywhere(34, seed), rng(seed).lognormal(0, 0.9, 34)
    large = np.argsort(-heights)[:5]
    copies = places[large] + [2, 9, -1] + rng(seed + 6).normal(0, 0.5, (5, 3))
    dim = 0.09 * heights[large] * rng(seed).normal(1, 0.1, 5)
    told = judged_by_copies(good(np.vstack([places, copies]), np.concatenate([heights, dim])), BOX)
    assert told.verdict is ShotVerdict.DOUBTFUL


@pytest.mark.parametrize("places_voxel", [anywhere(15), anywhere(60), anywhere(400), CLUSTERS, JET, TWO_JETS])
@pytest.mark.parametrize("seed", range(1))
def test_droplets_of_any_size_are_no_copies(places_voxel: FloatArray, seed: int) -> None:
    heights = rng(seed).lognormal(0, 0.8, len(places_voxel))
    assert judged_by_copies(good(places_voxel, heights), BOX).verdict is ShotVerdict.GOOD


@pytest.mark.parametrize("kind", ["scattered", "in a cone"])
@pytest.mark.parametrize("seed", range(3))
def test_copies_that_fly_apart_are_told(kind: str, seed: int) -> None:
    """By 3 voxels along each axis; or as in a cone, at speeds of 14 voxels that point away from its nozzle."""
    places = anywhere(40, seed)
    away = places - [150, -400, 150]
    fanned = 14 * away / np.linalg.norm(away, axis=1)[:, None] + rng(seed + 9).normal(0, 1, places.shape)
    ways = [14, 5, 0] + rng(seed + 9).normal(0, 3, places.shape) if kind == "scattered" else fanned
    told = judged_by_copies(good(np.vstack([places, places + ways])), BOX)
    assert told.verdict is ShotVerdict.DOUBTFUL
