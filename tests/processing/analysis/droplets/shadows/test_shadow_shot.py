"""Shadows against truth that shares no code with the finder, and what must not matter."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from processing.analysis.droplets.droplet_search import plan_droplets
from processing.analysis.droplets.ghost_share import matches
from processing.analysis.droplets.measured_exposure import ShotVerdict
from processing.analysis.droplets.shadows.judged_volume import beside_what_is_not_known
from processing.analysis.droplets.shadows.shadow_shot import ShadowExposure, measure_shadows
from processing.studies.droplets import IMAGE_SIZE_PX as STUDY_SIZE_PX
from processing.studies.shadows.sizes import SizeCase, size_scene
from processing.studies.simulated_droplets import study_grid
from processing.volume import VoxelGrid
from tests.support.shadow_scenes import ShadowScene, search_of, shadow_scene

Grey = NDArray[np.float32]
SHAPE, IMAGE_SIZE_PX, MARGIN_VOXEL = (120, 30, 200), (280, 80), 8


@pytest.fixture(scope="module")
def scene() -> ShadowScene:
    return shadow_scene(SHAPE, 14, IMAGE_SIZE_PX, seed=2)


@pytest.fixture(scope="module")
def shot(scene: ShadowScene) -> ShadowExposure:
    return measure_shadows(scene.images, search_of(scene, MARGIN_VOXEL), twins=1)


def test_a_shot_without_faults_is_good_and_its_twin_has_no_ghosts_or_few(shot: ShadowExposure) -> None:
    assert shot.verdict is ShotVerdict.GOOD
    assert shot.residual_over_noise == pytest.approx(1, abs=0.05)
    assert shot.twins is not None
    assert shot.twins.found > 0.8 * len(shot.droplets)
    assert shot.twins.ghosts <= 2
    placed, found = (sum(getattr(one, name) for one in shot.twins.classes) for name in ("placed", "found"))
    assert 0.95 * placed < found <= placed < 1.3 * len(shot.droplets)
    edges_um = [10 ** (one.number / 20) for one in shot.twins.classes]
    assert edges_um[0] < 1.1 * shot.droplets.diameters_um.min() < shot.droplets.diameters_um.max() < 1.3 * edges_um[-1]


def test_covariances_say_how_far_places_and_diameters_are_off(scene: ShadowScene, shot: ShadowExposure) -> None:
    match, _ = matches(shot.droplets.points_mm, scene.points_mm, scene.grid.pitch_mm)
    real = match >= 0
    errors_mm = (shot.droplets.points_mm - scene.points_mm[match])[real]
    scores = errors_mm / np.sqrt(np.einsum("nii->ni", shot.droplets.covariance_mm2[real]))
    assert 0.7 < np.median(np.abs(scores)) / 0.6745 < 1.3
    errors_um = (shot.droplets.diameters_um - 1000 * scene.diameters_mm[match])[real]
    assert 0.7 < np.median(np.abs(errors_um / shot.droplets.diameter_sd_um[real])) / 0.6745 < 1.4


def test_light_that_is_dimmer_than_its_background_does_not_matter(scene: ShadowScene, shot: ShadowExposure) -> None:
    dimmed = measure_shadows([image * np.float32(0.9) for image in scene.images], search_of(scene, MARGIN_VOXEL))
    match, _ = matches(dimmed.droplets.points_mm, shot.droplets.points_mm, 0.05 * scene.grid.pitch_mm)
    assert np.mean(match >= 0) > 0.97
    np.testing.assert_allclose(
        dimmed.droplets.diameters_um[match >= 0], shot.droplets.diameters_um[match[match >= 0]], atol=0.3
    )
    np.testing.assert_allclose([view.level for view in dimmed.views.values()], 0.9, atol=2e-3)
    assert dimmed.residual_over_noise == pytest.approx(shot.residual_over_noise, abs=0.01)


def test_a_black_level_without_a_dark_image_is_doubted(scene: ShadowScene) -> None:
    """Droplets look paler and smaller, and faint ones are made up; residual over noise alone would call it good."""
    black_level = np.float32(0.17)
    grey = [black_level + (1 - black_level) * image for image in scene.images]
    doubted = measure_shadows(grey, search_of(scene, MARGIN_VOXEL))
    assert doubted.verdict is ShotVerdict.DOUBTFUL, doubted.residual_over_noise
    assert any("of the light is left where shadows should be black" in reason for reason in doubted.reasons)


def test_a_dark_image_that_is_too_bright_is_doubted(scene: ShadowScene) -> None:
    """It is taken off images and background alike: shadows are below black, and droplets look larger."""
    excess = np.float32(0.07)
    told = measure_shadows([(image - excess) / (1 - excess) for image in scene.images], search_of(scene, MARGIN_VOXEL))
    assert told.verdict is ShotVerdict.DOUBTFUL
    assert "% of the light below black" in "".join(told.reasons)


@pytest.mark.parametrize("scattered", [True, False])
def test_a_background_near_saturation_is_no_empty_view(scene: ShadowScene, scattered: bool) -> None:
    """Nothing is known of a quarter of its pixels: here and there, or in a corner."""
    rng = np.random.default_rng(5)
    unknown = rng.random(scene.images[0].shape) < 0.25
    if not scattered:
        unknown = np.sort(unknown.ravel())[::-1].reshape(unknown.shape)
    trust = [np.where(unknown, 0, 1).astype(np.float32), *(np.ones_like(image) for image in scene.images[1:])]
    told = measure_shadows(scene.images, search_of(scene, MARGIN_VOXEL), trust=trust)
    said = "; ".join(told.reasons)
    assert ("has 25 % of its pixels, here and there, of which nothing is known" in said) == scattered, said
    assert (told.verdict is ShotVerdict.REFUSED) == scattered


@pytest.fixture(scope="module")
def small() -> ShadowScene:
    """Droplets of about two pixels, behind a blur of more than one: none is black in its middle."""
    return shadow_scene(SHAPE, 14, IMAGE_SIZE_PX, seed=3, median_mm=0.035, blurs_px=(1.2,) * 4, noise=0.0)


@pytest.mark.parametrize(("veil", "doubted"), [(0.0, False), (0.06, True), (0.2, True), (0.5, True)])
def test_a_veil_of_light_over_small_droplets_is_doubted(small: ShadowScene, veil: float, doubted: bool) -> None:
    """Stray light, or a second exposure that shows no droplet there: each looks smaller, and none looks odd."""
    rng = np.random.default_rng(4)
    images = [veil + (1 - veil) * image + rng.normal(0, 0.012, image.shape) for image in small.images]
    told = measure_shadows([image.astype(np.float32) for image in images], search_of(small, MARGIN_VOXEL))
    said = "; ".join(told.reasons)
    assert ("behind a veil" in said or "should be black" in said) == doubted, said


def moved_px(image: Grey, rows: int) -> Grey:
    """Droplets that fall by so many rows while the light is on."""
    return np.asarray(np.mean([np.roll(image, row, axis=0) for row in range(rows)], axis=0), dtype=np.float32)


def seen_twice(image: Grey, rows: int) -> Grey:
    """Two pulses of light within one exposure."""
    return np.asarray(0.5 * (image + np.roll(image, rows, axis=0)), dtype=np.float32)


@pytest.mark.parametrize(("spoil", "rows"), [(moved_px, 3), (moved_px, 6), (seen_twice, 6)])
def test_droplets_that_are_no_round_discs_are_doubted(spoil: Callable[[Grey, int], Grey], rows: int) -> None:
    """Small discs in a row explain each of them to about the noise of the whole image: too many, and too small."""
    rng, clear = np.random.default_rng(1), shadow_scene(SHAPE, 14, IMAGE_SIZE_PX, seed=2, noise=0.0)
    images = [(spoil(image, rows) + rng.normal(0, 0.012, image.shape)).astype(np.float32) for image in clear.images]
    told = measure_shadows(images, search_of(clear, MARGIN_VOXEL), light="gaussian")
    assert told.verdict is ShotVerdict.DOUBTFUL, told.residual_over_noise
    assert any("do not look like round opaque discs" in reason for reason in told.reasons)


MOVED, DEFOCUSED = ((0, 0), (1, 0)), ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))


@pytest.mark.parametrize(("ways_px", "blur_px", "noise"), [(MOVED, 0.65, 0.012), (DEFOCUSED, 0.5, 0.008)])
def test_light_from_few_directions_has_fringes(ways_px: tuple[tuple[int, int]], blur_px: float, noise: float) -> None:
    """Discs of 31 um in light of 0.8 apertures explain those of 40 um that moved, or are out of focus."""
    rng = np.random.default_rng(1)
    sharp = shadow_scene(SHAPE, 14, IMAGE_SIZE_PX, seed=2, noise=0.0, blurs_px=(blur_px,) * 4)
    images = [np.mean([np.roll(image, way, axis=(0, 1)) for way in ways_px], axis=0) for image in sharp.images]
    noisy = [(image + rng.normal(0, noise, image.shape)).astype(np.float32) for image in images]
    told = measure_shadows(noisy, search_of(sharp, MARGIN_VOXEL))
    assert told.verdict is ShotVerdict.DOUBTFUL, told.droplets.diameters_um.mean()
    assert any("of its fringes are there" in reason for reason in told.reasons)
    stated = measure_shadows(noisy, search_of(sharp, MARGIN_VOXEL), light="gaussian")
    assert stated.droplets.diameters_um.mean() == pytest.approx(1000 * sharp.diameters_mm.mean(), rel=0.03)


@pytest.mark.parametrize(("per_mm3", "noise"), [(3, 0.012), (14, 0.022)])
def test_few_droplets_that_move_or_noise_are_no_light_from_few_directions(per_mm3: float, noise: float) -> None:
    """Nobody can be sure that fringes are missing there, nor that they are there."""
    rng = np.random.default_rng(1)
    sharp = shadow_scene(SHAPE, per_mm3, IMAGE_SIZE_PX, seed=2, noise=0.0, blurs_px=(0.65,) * 4)
    images = [np.mean([np.roll(image, row, axis=0) for row in (0, 1)], axis=0) for image in sharp.images]
    noisy = [(image + rng.normal(0, noise, image.shape)).astype(np.float32) for image in images]
    told = measure_shadows(noisy, search_of(sharp, MARGIN_VOXEL))
    assert told.verdict is ShotVerdict.DOUBTFUL, told.droplets.diameters_um.mean()
    assert told.droplets.diameters_um.mean() == pytest.approx(1000 * sharp.diameters_mm.mean(), rel=0.03)


def test_two_lenses_out_of_focus_are_no_other_light() -> None:
    """One light is taken for all views: in the one that explains both kinds diameters would be 5 um larger."""
    rng, grid, ways_px = (
        np.random.default_rng(1),
        study_grid(SHAPE),
        np.argwhere(np.hypot(*np.mgrid[-2:3, -2:3]) < 2.2) - 2,
    )
    scene = size_scene(SizeCase(10, condenser_ratio=1.2), grid, IMAGE_SIZE_PX, np.random.default_rng(5))
    images = list(scene.images)
    for view in (0, 2):
        blurred = np.mean([np.roll(images[view], way, axis=(0, 1)) for way in ways_px], axis=0)
        images[view] = (blurred + rng.normal(0, 0.011, blurred.shape)).astype(np.float32)
    told = measure_shadows(images, plan_droplets(scene.believed, grid, margin_voxel=MARGIN_VOXEL))
    assert told.verdict is ShotVerdict.DOUBTFUL, told.droplets.diameters_um.mean()
    assert any("is a lens out of focus, or its aperture another one" in reason for reason in told.reasons)


def test_pixels_too_coarse_to_tell_the_light_do_not_tell_it() -> None:
    """Edges sharper than a pixel look like light of 0.8 apertures, in which diameters would be 6 um too small."""
    coarse = shadow_scene(SHAPE, 14, IMAGE_SIZE_PX, seed=2, blurs_px=(0.3,) * 4)
    told = measure_shadows(coarse.images, search_of(coarse, MARGIN_VOXEL))
    assert {view.condenser_ratio for view in told.views.values()} == {None}
    assert "which light this is cannot be told" in "; ".join(told.reasons)


def test_the_order_of_views_does_not_matter(scene: ShadowScene, shot: ShadowExposure) -> None:
    order = [2, 0, 3, 1]
    turned = replace(scene, images=[scene.images[k] for k in order], cameras=[scene.cameras[k] for k in order])
    other = measure_shadows(turned.images, search_of(turned, MARGIN_VOXEL))
    match, missed = matches(other.droplets.points_mm, shot.droplets.points_mm, 0.1 * scene.grid.pitch_mm)
    assert np.mean(match >= 0) > 0.97
    assert np.mean(missed >= 0) > 0.97


def test_what_is_not_known_is_not_believed(scene: ShadowScene, shot: ShadowExposure) -> None:
    trust = [np.ones_like(image) for image in scene.images]
    spoilt = [image.copy() for image in scene.images]
    for image, sure in zip(spoilt, trust, strict=True):
        image[:, :20], sure[:, :20] = 0.3, 0.0
    masked = measure_shadows(spoilt, search_of(scene, MARGIN_VOXEL), trust=trust)
    match, missed = matches(masked.droplets.points_mm, shot.droplets.points_mm, scene.grid.pitch_mm)
    assert masked.verdict is ShotVerdict.GOOD
    assert np.mean(match >= 0) > 0.97
    assert np.mean(missed >= 0) > 0.9


def test_a_box_within_the_spray_holds_the_droplets_that_the_whole_has_there(
    scene: ShadowScene, shot: ShadowExposure
) -> None:
    """Droplets above and below are seen too, by pixels that do not look into the box."""
    nz, ny, nx = SHAPE
    x_mm, y_mm, z_mm = scene.grid.origin_mm
    box = VoxelGrid((nz, ny // 3, nx), (x_mm, y_mm + ny // 3 * scene.grid.pitch_mm, z_mm), scene.grid.pitch_mm)
    part = measure_shadows(scene.images, plan_droplets(scene.cameras, box, margin_voxel=10))
    assert part.verdict is ShotVerdict.GOOD
    match, missed = matches(part.droplets.points_mm, shot.droplets.within(box).points_mm, 0.3 * box.pitch_mm)
    assert len(match) > 12
    assert np.mean(match >= 0) > 0.95
    assert np.mean(missed >= 0) > 0.95


def test_a_grid_that_no_pixel_looks_into_is_refused_and_not_good(scene: ShadowScene) -> None:
    x_mm, y_mm, z_mm = scene.grid.origin_mm
    nz, _, nx = SHAPE
    above = VoxelGrid((nz, 4, nx), (x_mm, y_mm - 3.0, z_mm), scene.grid.pitch_mm)
    unseen = measure_shadows(scene.images, plan_droplets(scene.cameras, above, margin_voxel=4))
    assert unseen.verdict is ShotVerdict.REFUSED
    assert "no pixel that is known looks into the grid" in unseen.reasons[0]


def test_exchanged_views_are_refused(scene: ShadowScene) -> None:
    images = [scene.images[k] for k in (3, 1, 2, 0)]
    other = measure_shadows(images, search_of(scene, MARGIN_VOXEL), twins=1)
    assert (other.verdict, len(other.droplets), other.twins) == (ShotVerdict.REFUSED, 0, None)
    assert other.residual_over_noise is not None
    assert other.residual_over_noise > 2


def test_pixels_behind_a_mosaic_of_colours_are_no_empty_view(scene: ShadowScene, shot: ShadowExposure) -> None:
    """Some get less light than their neighbours, and are trusted less: that is no noise which hides all droplets."""
    rows, columns = np.indices(scene.images[0].shape) % 2
    mosaic = np.array([[0.6, 1.4], [1.4, 0.3]], np.float32)[rows, columns]
    told = measure_shadows(scene.images, search_of(scene, MARGIN_VOXEL), trust=[mosaic] * len(scene.images))
    assert told.verdict is ShotVerdict.GOOD, told.reasons
    match, _ = matches(told.droplets.points_mm, shot.droplets.points_mm, 0.2 * scene.grid.pitch_mm)
    assert np.mean(match >= 0) > 0.97


def test_a_mosaic_that_the_background_does_not_show_is_divided_out(scene: ShadowScene, shot: ShadowExposure) -> None:
    """Raw values of a camera for colours over a background that was made grey: the view was told as *empty*."""
    rows, columns = np.indices(scene.images[0].shape) % 2
    levels = np.array([[0.6, 1.4], [1.4, 0.6]], np.float32)[rows, columns]
    told = measure_shadows([image * levels for image in scene.images], search_of(scene, MARGIN_VOXEL))
    assert told.verdict is ShotVerdict.GOOD, told.reasons
    match, _ = matches(told.droplets.points_mm, shot.droplets.points_mm, 0.2 * scene.grid.pitch_mm)
    assert np.mean(match >= 0) > 0.97
    own, other = told.droplets.diameters_um[match >= 0], shot.droplets.diameters_um[match[match >= 0]]
    np.testing.assert_allclose(own.mean(), other.mean(), rtol=0.005)


def test_images_without_droplets_are_empty_and_a_covered_view_is_named(scene: ShadowScene) -> None:
    rng, search = np.random.default_rng(0), search_of(scene, MARGIN_VOXEL)
    empty = [rng.normal(1, 0.012, image.shape).astype(np.float32) for image in scene.images]
    assert measure_shadows(empty, search).verdict is ShotVerdict.EMPTY
    one_blind = measure_shadows([*scene.images[:2], empty[2], scene.images[3]], search)
    assert one_blind.verdict is ShotVerdict.REFUSED
    assert "view 3 sees nothing while the others see droplets" in one_blind.reasons[0]


def test_droplets_in_the_background_alone_are_refused_and_not_empty(scene: ShadowScene) -> None:
    told = measure_shadows([2 - image for image in scene.images], search_of(scene, MARGIN_VOXEL))
    assert told.verdict is ShotVerdict.REFUSED
    assert "droplets in the dark image or the background" in told.reasons[0]


@pytest.mark.parametrize("light", [0.0, 0.3, 3.0])
def test_views_without_light_are_refused_and_not_empty(scene: ShadowScene, light: float) -> None:
    rng, search = np.random.default_rng(0), search_of(scene, MARGIN_VOXEL)
    empty = [rng.normal(1, 0.012, image.shape).astype(np.float32) for image in scene.images]
    for unlit in ((1,), (0, 1, 2, 3)):
        images = [image + np.float32(light - 1) * (view in unlit) for view, image in enumerate(empty)]
        shot = measure_shadows(images, search)
        assert shot.verdict is ShotVerdict.REFUSED
        assert len(shot.reasons) == len(unlit)
        assert "view 2: its light is" in "; ".join(shot.reasons)


def test_views_of_which_nothing_is_known_are_refused_and_not_empty(scene: ShadowScene) -> None:
    trust = [np.ones_like(image) for image in scene.images]
    trust[2][:] = 0
    shot = measure_shadows(scene.images, search_of(scene, MARGIN_VOXEL), trust=trust)
    assert (shot.verdict, len(shot.droplets)) == (ShotVerdict.REFUSED, 0)
    assert "view 3 has 0 % of its pixels that are known" in shot.reasons[0]


def test_bad_images_are_named(scene: ShadowScene) -> None:
    search, broken = search_of(scene, MARGIN_VOXEL), scene.images[1].copy()
    broken[3, 7] = np.nan
    with pytest.raises(ValueError, match=r"view 2: pixel \(column 7, row 3\) is nan"):
        measure_shadows([scene.images[0], broken, *scene.images[2:]], search)
    with pytest.raises(ValueError, match="3 images for 4 views"):
        measure_shadows(scene.images, search, trust=scene.images[:3])


@pytest.mark.parametrize("views", [(0, 3), (0, 1, 3)])
def test_few_droplets_need_no_more_than_two_views(views: tuple[int, ...]) -> None:
    sparse = shadow_scene(SHAPE, 3, IMAGE_SIZE_PX)
    fewer = replace(sparse, images=[sparse.images[k] for k in views], cameras=[sparse.cameras[k] for k in views])
    shot = measure_shadows(fewer.images, search_of(fewer, MARGIN_VOXEL))
    of_found, of_truth = matches(shot.droplets.points_mm, sparse.points_mm, sparse.grid.pitch_mm)
    assert np.mean(of_truth[sparse.diameters_mm > 0.02] >= 0) >= 0.8
    assert np.mean(of_found < 0) <= 0.2


def test_droplets_too_small_to_be_told_are_no_sparse_spray() -> None:
    """Eleven droplets of 12 um; what views see beyond noise is theirs, and next to none of them is found."""
    tiny = shadow_scene((80, 30, 120), 8, (180, 80), seed=5, median_mm=0.012, blurs_px=(0.7,) * 4, sharp=True)
    told = measure_shadows(tiny.images, search_of(tiny, 10), light=2.0)
    assert told.verdict is ShotVerdict.DOUBTFUL
    assert len(told.droplets) < 0.5 * len(tiny.points_mm)
    assert ["of what views see beyond their noise" in reason for reason in told.reasons] == [True]


@pytest.mark.parametrize(("median_mm", "cut"), [(0.0108, True), (0.032, False)])
def test_a_spray_most_of_which_is_too_small_to_be_found_is_doubted(median_mm: float, cut: bool) -> None:
    """What is found explains the images; its mean diameter was a third too large, and *good*."""
    spray = shadow_scene(SHAPE, 24, IMAGE_SIZE_PX, seed=11, median_mm=median_mm, least_mm=0.002)
    shot = measure_shadows(spray.images, search_of(spray, MARGIN_VOXEL), light="gaussian")
    ratio = float(shot.droplets.diameters_um.mean() / (1000 * spray.diameters_mm.mean()))
    assert (ratio > 1.2) is cut, "the mean diameter is that of a part"
    assert [reason for reason in shot.reasons if "goes on below" in reason and "D10 is too large" in reason] == (
        list(shot.reasons) if cut else []
    )
    assert (shot.verdict is ShotVerdict.DOUBTFUL) is cut


def test_a_dense_spray_that_two_views_do_not_know_a_band_of_is_doubted() -> None:
    """A third of what is told is ghosts, and droplets and ghosts together explain the images well."""
    grid = study_grid((250, 20, 500))
    spray = size_scene(SizeCase(density_per_mm3=28), grid, STUDY_SIZE_PX, np.random.default_rng(14))
    trust = [np.ones_like(image) for image in spray.images]
    for known in trust[:2]:
        known[:, known.shape[1] // 2 - 50 : known.shape[1] // 2 + 50] = 0
    shot = measure_shadows(spray.images, plan_droplets(spray.believed, grid), trust=trust, light="gaussian")
    match, _ = matches(shot.droplets.points_mm, spray.spray.positions_mm, grid.pitch_mm)
    assert np.mean(match < 0) > 0.2, "this shot has ghosts"
    assert shot.verdict is ShotVerdict.DOUBTFUL
    assert "not all views know" in shot.reasons[0]


def test_droplets_that_all_views_know_or_that_explain_the_images_are_not_doubted() -> None:
    knowing = np.array([4] * 8 + [3] * 2)
    assert beside_what_is_not_known(knowing, 3, 1.2, 0.2) == ()
    assert beside_what_is_not_known(knowing, 4, 1.09, 0.2) == ()
    assert beside_what_is_not_known(knowing, 4, 1.2, 0.09) == ()
    assert beside_what_is_not_known(np.full(5, 4), 4, 1.2, 0.2) == ()
    assert beside_what_is_not_known(np.empty(0, np.int64), 4, 1.2, 0.2) == ()
    assert beside_what_is_not_known(knowing, 4, 1.2, 0.2)[0].startswith("not all views know 20 % of the droplets")
