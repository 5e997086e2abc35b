"""Droplets of shadows whose renderer unites discs and shares no code with the finder; and steps of the search."""

import numpy as np
import pytest

from processing.analysis.droplets.ghost_share import matches
from processing.analysis.droplets.shadows.discs.disc_optics import (
    LEAST_BLUR_PX,
    MOST_BLUR_PX,
    first_disc_optics,
    held_variances,
)
from processing.analysis.droplets.shadows.discs.disc_supports import DiscSupports, supporting_views, undisputed
from processing.analysis.droplets.shadows.discs.merged_discs import merged_discs
from processing.analysis.droplets.shadows.discs.opaque_discs import Discs
from processing.analysis.droplets.shadows.shadow_finder import find_shadows
from processing.analysis.droplets.shadows.shadow_fit import ShadowFit, Transmissions
from tests.support.shadow_scenes import BLURS_PX, ShadowScene, search_of, shadow_scene

SHAPE, IMAGE_SIZE_PX, MARGIN_VOXEL = (120, 30, 200), (280, 80), 8


@pytest.fixture(scope="module")
def scene() -> ShadowScene:
    return shadow_scene(SHAPE, 20, IMAGE_SIZE_PX)


@pytest.fixture(scope="module")
def fit(scene: ShadowScene) -> ShadowFit:
    search = search_of(scene, MARGIN_VOXEL)
    trust = tuple(np.ones_like(image) for image in scene.images)
    return find_shadows(Transmissions(tuple(scene.images), trust, search.lattice), search)


def test_droplets_are_found_where_they_are_as_large_as_they_are(scene: ShadowScene, fit: ShadowFit) -> None:
    points_voxel = scene.grid.to_index(scene.points_mm)[:, ::-1] + MARGIN_VOXEL
    of_found, of_truth = matches(fit.discs.positions_voxel, points_voxel)
    large = scene.diameters_mm > 0.02
    assert np.mean(of_truth[large] >= 0) >= 0.97
    assert np.mean(of_found < 0) <= 0.02
    real = of_found >= 0
    errors_um = 2000 * fit.discs.radii_voxel[real] * scene.grid.pitch_mm - 1000 * scene.diameters_mm[of_found[real]]
    assert np.median(errors_um) == pytest.approx(0, abs=0.15)
    assert 1.4826 * np.median(np.abs(errors_um)) < 0.4


def test_noise_blur_level_and_shift_come_from_the_images(fit: ShadowFit) -> None:
    np.testing.assert_allclose(fit.optics.blurs_px(68.0), BLURS_PX, rtol=0.04)
    np.testing.assert_allclose(fit.noises, 0.012, rtol=0.05)
    np.testing.assert_allclose(fit.optics.levels, 1, atol=1e-3)
    np.testing.assert_allclose(fit.optics.shifts_px, 0, atol=0.03)


def test_the_first_guess_of_the_blur_is_near(scene: ShadowScene) -> None:
    np.testing.assert_allclose(first_disc_optics(scene.images).blurs_px(0.0), BLURS_PX, rtol=0.4)


def test_of_discs_within_a_larger_one_the_larger_stays() -> None:
    some = Discs(np.array([[0.0, 0, 0], [2.0, 0, 0], [9, 0, 0], [9.5, 0, 0]]), np.array([25.0, 4.0, 1.0, 0.5]))
    merged = merged_discs(some)
    np.testing.assert_array_equal(merged.positions_voxel, [[0, 0, 0], [9, 0, 0]])
    np.testing.assert_allclose(merged.squares_voxel2, [25, 1.25])
    assert len(merged_discs(Discs.none())) == 0


def said(alone: list[float], sd: float) -> DiscSupports:
    """What four views say of one disc whose squared radius is 1."""
    sums = np.zeros((4, 1, 11))
    sums[:, 0, 6] = 1 / sd**2
    sums[:, 0, 7] = (np.array(alone) - 1) / sd**2
    return DiscSupports(np.ones(1), sums)


@pytest.mark.parametrize(
    ("alone", "sd", "expected"),
    [
        ([1.0, 1.0, 0.9, 1.1], 0.02, (True, 4)),
        ([1.0, 1.0, 1.0, 0.3], 0.02, (False, 3)),
        ([1.0, 1.0, 0.3, 0.3], 0.02, (False, 2)),
        ([1.0, 1.0, 1.0, 1.0], 0.1, (False, 4)),
        ([1.0, 1.0, 1.0, 1.0], 0.5, (False, 0)),
    ],
)
def test_views_support_and_dispute_each_alone(alone: list[float], sd: float, expected: tuple[bool, int]) -> None:
    supports = said(alone, sd)
    assert (bool(undisputed(supports)[0]), int(supporting_views(supports)[0])) == expected


def test_blurs_stay_those_of_a_lens_and_what_is_one_is_not_touched() -> None:
    middle = 60.0
    z_voxel = np.linspace(0, 2 * middle, 50)
    rng = np.random.default_rng(0)
    proposed = np.column_stack([rng.normal(0.8, 1, 200), rng.normal(0, 0.02, 200), rng.normal(0, 1e-4, 200)])
    proposed[:2] = [[0.5, -1e-4, 1e-12], [0.9 + middle**2 * 1e-4, -2 * middle * 1e-4, 1e-4]]
    blurs_px = np.sqrt(held_variances(proposed, middle) @ np.stack([np.ones(50), z_voxel, z_voxel**2]))
    assert blurs_px.min(axis=1).min() >= LEAST_BLUR_PX - 1e-9
    assert blurs_px.min(axis=1).max() <= MOST_BLUR_PX + 1e-9
    np.testing.assert_allclose(held_variances(proposed[:2], middle), proposed[:2])
