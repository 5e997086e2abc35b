"""Shadows that are a little longer than wide, all in the same direction, are told; round ones are not."""

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d

from processing.analysis.droplets.measured_exposure import ShotVerdict
from processing.analysis.droplets.shadows.shadow_shot import measure_shadows
from processing.analysis.droplets.verdicts.elongation import (
    Elongation,
    elongation_told,
    lumps_of,
    seen_elongation,
)
from tests.support.shadow_scenes import search_of, shadow_scene

RADIUS_PX, BLUR_PX, APART_PX = 2.0, 0.8, 30


def shadows(turned_deg: float, ratio: float, *, count: int = 60, noise: float = 0.01) -> list[Elongation]:
    """Of ovals as dark as Gaussians, of which four views show the same."""
    rng = np.random.default_rng(4)
    return [_view(np.radians(turned_deg), ratio, count, noise, rng) for _ in range(4)]


def _view(direction: float, ratio: float, count: int, noise: float, rng: np.random.Generator) -> Elongation:
    row, column = np.mgrid[:APART_PX, :APART_PX]
    tiles, centres_px = [], APART_PX / 2 + rng.uniform(-3, 3, (count, 2))
    for u, v in centres_px:
        along = (column - u) * np.cos(direction) + (row - v) * np.sin(direction)
        across = (row - v) * np.cos(direction) - (column - u) * np.sin(direction)
        tiles.append(1 - 0.9 * np.exp(-(along**2 / ratio + across**2 * ratio) / RADIUS_PX**2))
    image = np.concatenate(tiles, axis=1) + rng.normal(0, noise, (APART_PX, count * APART_PX))
    centres_px[:, 0] += APART_PX * np.arange(count)
    known, radii_px = np.ones(image.shape, np.float32), np.full(count, RADIUS_PX)
    seen = seen_elongation(image.astype(np.float32), known, centres_px, radii_px, np.arange(count), BLUR_PX)
    assert seen is not None
    return seen


@pytest.mark.parametrize("turned_deg", [0, 45, 90, 160])
def test_ovals_are_told_in_any_direction_and_wrong_where_they_are_long(turned_deg: float) -> None:
    told, is_wrong = elongation_told(shadows(turned_deg, 1.05))
    assert "longer than wide" in told
    assert not is_wrong
    assert elongation_told(shadows(turned_deg, 1.25))[1]


@pytest.mark.parametrize(("count", "noise"), [(60, 0.01), (60, 0.03), (5, 0.01)])
def test_round_shadows_are_round(count: int, noise: float) -> None:
    assert elongation_told(shadows(0, 1.0, count=count, noise=noise)) == ("", False)
    assert elongation_told([]) == ("", False)


def test_few_shadows_of_many_shots_tell_together() -> None:
    few = [shadows(0, 1.25, count=4)[:1][0] for _ in range(8)]
    assert elongation_told(few[:1]) == ("", False)
    assert elongation_told([Elongation.together(few)])[1]


def test_droplets_that_overlap_in_space_are_one() -> None:
    places = np.array([[0, 0, 0], [1.5, 0, 0], [0, 9, 0], [2.9, 0, 0]], np.float64)
    assert lumps_of(places, np.ones(4)).tolist() == [0, 0, 1, 0]
    assert lumps_of(np.empty((0, 3)), np.empty(0)).tolist() == []


@pytest.mark.parametrize(("smear_px", "is_doubted"), [(1, False), (3, True)])
def test_droplets_that_move_while_the_light_is_on_are_doubted(smear_px: int, is_doubted: bool) -> None:
    scene = shadow_scene((120, 30, 200), 5, (280, 80), seed=3, noise=0, blurs_px=(0.9,) * 4, median_mm=0.05)
    rng = np.random.default_rng(3)
    smeared = (uniform_filter1d(image, smear_px, axis=0) for image in scene.images)
    images = [(image + rng.normal(0, 0.012, image.shape)).astype(np.float32) for image in smeared]
    shot = measure_shadows(images, search_of(scene, margin_voxel=8), light="gaussian")
    assert (shot.verdict is ShotVerdict.DOUBTFUL) is is_doubted
    assert any("longer than wide" in reason for reason in shot.reasons) is is_doubted
