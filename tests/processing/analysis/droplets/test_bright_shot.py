"""Bright particles against truth that shares no code with the finder, and what must not matter."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from processing.analysis.droplets.bright_shot import BrightExposure, measure_bright
from processing.analysis.droplets.droplet_search import plan_droplets
from processing.analysis.droplets.gaussian_blobs import BlobImages, BlobOptics, Blobs, Image
from processing.analysis.droplets.ghost_share import GhostShare, matches, told_share
from processing.analysis.droplets.measured_exposure import ShotVerdict, told_real
from processing.analysis.droplets.point_spread import MOST_SIGMA_PX, refined_optics
from processing.analysis.droplets.verdicts.explained_images import RatioLimits, judged
from processing.analysis.droplets.verdicts.twins import judged_by_twins
from processing.analysis.estimates import Estimate
from processing.analysis.hidden import Hidden
from processing.geometry import FloatArray
from processing.kernels import _native
from processing.reconstruction.errors import ReconstructionError, RoughMapping
from processing.studies.droplets import BrightScene, DropletCase, bright_images
from processing.volume import VoxelGrid
from tests.support.bright_scenes import GRID, MARGIN_VOXEL, scene, search_of


def found_and_ghosts(shot: BrightExposure, truth: BrightScene) -> tuple[float, float]:
    of_found, of_truth = matches(shot.droplets.points_mm, truth.points_mm, GRID.pitch_mm)
    return float(np.mean(of_truth >= 0)), float(np.mean(of_found < 0))


@pytest.fixture(scope="module")
def truth() -> BrightScene:
    return scene()


@pytest.fixture(scope="module")
def shot(truth: BrightScene) -> BrightExposure:
    return measure_bright(truth.images, search_of(truth), twins=1)


def test_droplets_are_found_where_they_are_as_bright_as_they_are(truth: BrightScene, shot: BrightExposure) -> None:
    found, ghosts = found_and_ghosts(shot, truth)
    assert found >= 0.98
    assert ghosts <= 0.02
    match, _ = matches(shot.droplets.points_mm, truth.points_mm, GRID.pitch_mm)
    real = match >= 0
    errors_mm = (shot.droplets.points_mm - truth.points_mm[match])[real]
    assert np.sqrt(np.mean(errors_mm**2)) < 0.06 * GRID.pitch_mm
    ratio = shot.droplets.amplitudes[real] / truth.heights[match[real]]
    assert np.median(ratio) == pytest.approx(1, abs=0.01)
    assert shot.verdict is ShotVerdict.GOOD
    assert shot.residual_over_noise == pytest.approx(1, abs=0.03)


def test_covariances_say_how_far_droplets_are_off(truth: BrightScene, shot: BrightExposure) -> None:
    match, _ = matches(shot.droplets.points_mm, truth.points_mm, GRID.pitch_mm)
    real = match >= 0
    errors_mm = (shot.droplets.points_mm - truth.points_mm[match])[real]
    scores = errors_mm / np.sqrt(np.einsum("nii->ni", shot.droplets.covariance_mm2[real]))
    assert 0.8 < np.median(np.abs(scores)) / 0.6745 < 1.3


def test_two_views_of_a_dense_spray_are_doubted_although_they_explain_their_images() -> None:
    """Nobody asked for twins; more than half of what two views give is ghosts."""
    truth = scene(DropletCase(28, views=2))
    shot = measure_bright(truth.images, search_of(truth))
    assert found_and_ghosts(shot, truth)[1] > 0.3
    assert shot.residual_over_noise == pytest.approx(1, abs=0.04)
    assert (shot.verdict, shot.reasons[0][:25]) == (ShotVerdict.DOUBTFUL, "of the droplets of a twin")


def test_views_along_the_same_lines_count_once() -> None:
    """Four cameras, as two pairs that look alike or at each other, see as many ghosts as two."""
    truth, rng = scene(DropletCase(28, views=2)), np.random.default_rng(1)
    images = [image + rng.normal(0, 0.03, image.shape).astype(np.float32) for image in truth.images for _ in range(2)]
    cameras = [camera for camera in truth.believed for _ in range(2)]
    shot = measure_bright(images, plan_droplets(cameras, GRID, margin_voxel=MARGIN_VOXEL))
    assert found_and_ghosts(shot, truth)[1] > 0.3
    assert (shot.verdict, [reason[:25] for reason in shot.reasons]) == (
        ShotVerdict.DOUBTFUL,
        ["of the droplets of a twin"],
    )


def test_wide_spots_of_four_views_are_asked_by_a_twin() -> None:
    """No probability was tried on them: nothing else tells their ghosts."""
    truth = scene(DropletCase(28, sigma_px=2.4))
    shot = measure_bright(truth.images, search_of(truth))
    assert not np.isfinite(shot.droplets.p_real).any()
    assert shot.twins is not None
    assert shot.twins.found > 0.8 * len(truth.points_mm)


def of_heights(heights: FloatArray, case: DropletCase, seed: int = 1) -> BrightScene:
    """As many spots as there are heights, anywhere."""
    rng = np.random.default_rng(seed)
    empty = scene(case)
    points_mm = GRID.to_mm(rng.uniform(3, np.array(GRID.shape) - 4, (len(heights), 3)))
    return replace(
        empty,
        points_mm=points_mm,
        heights=heights,
        images=bright_images(case, empty.believed, points_mm, heights, rng),
    )


@pytest.mark.parametrize("noise_percent", [0.3, 1.0])
@pytest.mark.parametrize("times", [20, 25])
def test_a_class_of_droplets_too_faint_to_be_told_is_missed(times: float, noise_percent: float) -> None:
    """Its light is left over; beside the bright ones it is less than what the model may be off."""
    truth = of_heights(np.repeat([1.0, 1 / times], 20), DropletCase(noise_percent=noise_percent))
    told = measure_bright(truth.images, search_of(truth))
    assert len(told.droplets) == pytest.approx(20, abs=1)
    assert told.residual_over_noise is not None
    assert told.residual_over_noise < 1.05
    assert told.verdict is ShotVerdict.DOUBTFUL
    assert "fainter than a tenth of a typical one" in told.reasons[0]


def test_heavy_wings_of_spots_are_no_droplets() -> None:
    truth, rng = scene(DropletCase(5), seed=2), np.random.default_rng(2)
    row, column = np.ogrid[: truth.images[0].shape[0], : truth.images[0].shape[1]]
    images = []
    for camera in truth.believed:
        image = rng.normal(0, 0.03, truth.images[0].shape)
        for (u, v), height in zip(camera.project(truth.points_mm), truth.heights, strict=True):
            image += height * (1 + ((row - v) ** 2 + (column - u) ** 2) / 8.6) ** -3
        images.append(image.astype(np.float32))
    told = measure_bright(images, search_of(truth))
    assert found_and_ghosts(told, truth) == (1, 0)
    assert told.verdict is ShotVerdict.GOOD


@pytest.mark.parametrize("case", [DropletCase(28, 1.5, 45), DropletCase(28, 1.0, 30)])
def test_droplets_that_noise_hides_are_missed(case: DropletCase) -> None:
    truth = scene(case, seed=2)
    told = measure_bright(truth.images, search_of(truth))
    assert found_and_ghosts(told, truth)[0] < 0.85
    assert told.verdict is ShotVerdict.DOUBTFUL
    assert "the distribution of amplitudes goes on below" in told.reasons[0]


@pytest.mark.parametrize("case", [DropletCase(14, 0.8, 10), DropletCase(14, 1.0, 25), DropletCase(14, 2.0, 25)])
def test_nearly_all_are_found_from_the_amplitude_on_that_is_told(case: DropletCase) -> None:
    truth = of_heights(np.geomspace(0.05, 5, 40), case, seed=3)
    told = measure_bright(truth.images, search_of(truth))
    (limit,) = {view.complete_from for view in told.views.values()}
    assert 0.2 < limit < 2
    found = matches(told.droplets.points_mm, truth.points_mm, 1.5 * GRID.pitch_mm)[1] >= 0
    assert np.mean(found[truth.heights > limit]) >= 0.94
    assert np.mean(found[truth.heights < 0.4 * limit]) <= 0.1


def test_spots_as_wide_as_any_can_be_refined(truth: BrightScene) -> None:
    """In noise the fit may come there."""
    images = BlobImages(tuple(truth.images), search_of(truth).lattice)
    levels = tuple(np.zeros_like(image) for image in truth.images)
    widest = BlobOptics(np.ones(4), np.full((4, 2), MOST_SIGMA_PX), np.zeros((4, 2)), levels)
    refined = refined_optics(images, widest, Blobs(np.array([[86.0, 26.0, 46.0]]), np.ones(1)), shifts=True)
    assert np.max(refined.sigmas_px) <= MOST_SIGMA_PX


def test_noise_and_widths_come_from_the_images(shot: BrightExposure) -> None:
    for view in shot.views.values():
        assert view.noise == pytest.approx(0.03, rel=0.03)
        assert (view.sigma_u_px, view.sigma_v_px) == pytest.approx((1, 1), abs=0.01)
        assert view.offset == pytest.approx(0, abs=0.002)


def test_twins_of_a_shot_without_ghosts_have_none_or_few(shot: BrightExposure) -> None:
    assert shot.twins is not None
    assert shot.twins.found > 0.8 * len(shot.droplets)
    assert shot.twins.share is not None
    assert shot.twins.share < 0.03
    assert shot.twins.interval is not None
    assert shot.twins.interval[1] > shot.twins.share


def test_a_good_shot_tells_its_ghosts_and_a_doubtful_one_why_it_does_not(shot: BrightExposure) -> None:
    assert shot.ghost_share == told_share(shot.droplets.p_real, False)
    assert isinstance(shot.ghost_share, Estimate)
    assert shot.ghost_share.value < 0.02
    assert replace(shot, verdict=ShotVerdict.DOUBTFUL, reasons=("it is blurred",)).ghost_share == "it is blurred"


def test_beside_many_ligaments_nothing_tells_of_ghosts(shot: BrightExposure) -> None:
    many = told_real(replace(shot, hidden=Hidden(liquid_objects=1 + len(shot.droplets) // 100)))
    assert told_real(shot).ghost_share == shot.ghost_share
    assert isinstance(many.ghost_share, str)
    assert many.ghost_share.endswith("beside more ligaments and the like than 1 % of the droplets")


def test_a_shot_whose_twin_is_full_of_ghosts_is_doubtful(shot: BrightExposure) -> None:
    doubtful = judged_by_twins(shot, GhostShare(30, 100))
    assert doubtful.verdict is ShotVerdict.DOUBTFUL
    assert doubtful.reasons == (
        "of the droplets of a twin 30 % are ghosts, limit 10 %: too many droplets for so few views",
    )
    assert judged_by_twins(shot, GhostShare(0, 0)).verdict is ShotVerdict.GOOD


def test_neither_scale_nor_level_of_the_images_matters(truth: BrightScene, shot: BrightExposure) -> None:
    scaled = measure_bright([8 * image + np.float32(2) for image in truth.images], search_of(truth))
    assert len(scaled.droplets) == len(shot.droplets)
    np.testing.assert_allclose(scaled.droplets.points_mm, shot.droplets.points_mm, atol=1e-3 * GRID.pitch_mm)
    np.testing.assert_allclose(scaled.droplets.amplitudes, 8 * shot.droplets.amplitudes, rtol=1e-3)
    np.testing.assert_allclose([view.offset for view in scaled.views.values()], 2, atol=0.02)


def test_the_order_of_views_does_not_matter(truth: BrightScene, shot: BrightExposure) -> None:
    order = [2, 0, 3, 1]
    turned = replace(truth, images=[truth.images[k] for k in order], believed=[truth.believed[k] for k in order])
    other = measure_bright(turned.images, search_of(turned))
    match, missed = matches(other.droplets.points_mm, shot.droplets.points_mm, 0.1 * GRID.pitch_mm)
    assert np.mean(match >= 0) > 0.98
    assert np.mean(missed >= 0) > 0.98


def test_threads_do_not_change_a_bit(truth: BrightScene) -> None:
    one, three = (measure_bright(truth.images, search_of(truth), threads=threads).droplets for threads in (1, 3))
    for first, second in zip(one.columns().values(), three.columns().values(), strict=True):
        np.testing.assert_array_equal(first, second)


def test_droplets_beside_the_grid_are_told_by_the_residual_without_a_margin_and_do_no_harm_with_one() -> None:
    x_mm, y_mm, z_mm = GRID.origin_mm
    beside_mm = 12 * GRID.pitch_mm
    truth = scene(grid=VoxelGrid((104, 40, 184), (x_mm - beside_mm, y_mm, z_mm - beside_mm), GRID.pitch_mm))
    alone = measure_bright(truth.images, search_of(truth, margin_voxel=0), twins=1)
    assert alone.verdict in (ShotVerdict.DOUBTFUL, ShotVerdict.REFUSED)
    assert alone.twins is None
    with_margin = measure_bright(truth.images, search_of(truth, margin_voxel=14))
    assert with_margin.verdict is ShotVerdict.GOOD
    assert found_and_ghosts(with_margin, truth)[1] < 0.02


@pytest.mark.parametrize("level", [0.0, 0.2])
def test_images_without_droplets_are_empty(truth: BrightScene, level: float) -> None:
    rng = np.random.default_rng(0)
    noise = [(level + rng.normal(0, 0.03, image.shape)).astype(np.float32) for image in truth.images]
    shot = measure_bright(noise, search_of(truth))
    assert (shot.verdict, len(shot.droplets), shot.reasons) == (ShotVerdict.EMPTY, 0, ("no view sees a droplet",))
    dark = measure_bright([np.full_like(image, level) for image in truth.images], search_of(truth))
    assert dark.verdict is ShotVerdict.EMPTY


def lit(image: Image, glow: Callable[[FloatArray, FloatArray], FloatArray]) -> Image:
    """With scattered light, of places from -1 to 1 along columns and rows."""
    rows, columns = (np.linspace(-1, 1, size_px) for size_px in image.shape)
    return np.asarray(image + glow(columns[None], rows[:, None]), np.float32)


def hill(along: FloatArray, down: FloatArray) -> FloatArray:
    """120 pixels wide, 7 times the noise high."""
    return 0.2 * np.exp(-(along**2) / 0.36 - (down**2) / 2)


def weak_spot(along: FloatArray, down: FloatArray) -> FloatArray:
    return 0.1 * np.exp(-((along - 0.3) ** 2) / 0.1 - (down**2) / 0.5)


def ramp(along: FloatArray, down: FloatArray) -> FloatArray:
    return 1.5 * along + 0.5 * down


@pytest.mark.parametrize("glow", [hill, weak_spot, ramp])
@pytest.mark.parametrize("views", [(0, 1, 2, 3), (2,)])
def test_a_smooth_glow_that_the_background_lacks_makes_no_ghosts(
    truth: BrightScene, glow: Callable[[FloatArray, FloatArray], FloatArray], views: tuple[int, ...]
) -> None:
    images = [lit(image, glow) if view in views else image for view, image in enumerate(truth.images)]
    told = measure_bright(images, search_of(truth))
    found, ghosts = found_and_ghosts(told, truth)
    assert ghosts <= 0.02
    assert found >= 0.98
    assert told.verdict is ShotVerdict.GOOD
    match, _ = matches(told.droplets.points_mm, truth.points_mm, GRID.pitch_mm)
    ratio = (told.droplets.amplitudes / truth.heights[match])[match >= 0]
    assert np.median(ratio) == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("views", [(0, 1, 2, 3), (2,)])
def test_a_glow_without_droplets_is_empty(truth: BrightScene, views: tuple[int, ...]) -> None:
    rng = np.random.default_rng(0)
    noise = [rng.normal(0, 0.03, image.shape).astype(np.float32) for image in truth.images]
    images = [lit(image, hill) if view in views else image for view, image in enumerate(noise)]
    assert measure_bright(images, search_of(truth)).verdict is ShotVerdict.EMPTY


def streaks(image: Image) -> Image:
    """Of droplets that move by five pixels, askew, while the light is on."""
    return np.asarray(np.mean([np.roll(image, (step, step), (0, 1)) for step in range(-2, 3)], axis=0), np.float32)


def saturated(image: Image) -> Image:
    """At half of the height of a droplet."""
    return np.minimum(image, np.float32(0.5))


@pytest.mark.parametrize("spoil", [streaks, saturated])
def test_what_only_several_droplets_explain_is_doubted(truth: BrightScene, spoil: Callable[[Image], Image]) -> None:
    """They explain it to the noise: residual over noise is that of a good shot."""
    rng = np.random.default_rng(2)
    images = [(spoil(image) + rng.normal(0, 0.03, image.shape)).astype(np.float32) for image in truth.images]
    told = measure_bright(images, search_of(truth))
    assert told.verdict is ShotVerdict.DOUBTFUL
    assert "beyond chance" in told.reasons[-1]


def test_droplets_of_the_other_polarity_are_refused_and_not_empty(truth: BrightScene) -> None:
    shadows = [(1 - 0.5 * image).astype(np.float32) for image in truth.images]
    told = measure_bright(shadows, search_of(truth))
    assert told.verdict is ShotVerdict.REFUSED
    assert "is the polarity another" in told.reasons[0]


def test_a_black_view_is_named_and_nothing_is_told(truth: BrightScene) -> None:
    images = [*truth.images[:2], np.zeros_like(truth.images[2]), truth.images[3]]
    shot = measure_bright(images, search_of(truth))
    assert (shot.verdict, len(shot.droplets)) == (ShotVerdict.REFUSED, 0)
    assert "view 3 sees nothing while the others see droplets" in shot.reasons[0]


def test_exchanged_views_are_refused(truth: BrightScene) -> None:
    images = [truth.images[3], *truth.images[1:3], truth.images[0]]
    shot = measure_bright(images, search_of(truth), twins=1)
    assert (shot.verdict, len(shot.droplets), shot.twins) == (ShotVerdict.REFUSED, 0, None)
    assert shot.residual_over_noise is not None
    assert shot.residual_over_noise > 1.5


def test_a_calibration_that_is_off_by_a_tenth_of_a_pixel_does_no_harm() -> None:
    truth = scene(DropletCase(28, calibration_error_px=0.1))
    shot = measure_bright(truth.images, search_of(truth))
    found, ghosts = found_and_ghosts(shot, truth)
    assert found >= 0.97
    assert ghosts <= 0.02
    assert max(abs(view.shift_u_px) for view in shot.views.values()) > 0.03


def test_a_calibration_that_is_off_by_half_a_pixel_is_refused_with_a_remedy() -> None:
    truth = scene(DropletCase(28, calibration_error_px=0.6))
    shot = measure_bright(truth.images, search_of(truth))
    assert shot.verdict is ShotVerdict.REFUSED
    assert "px beside its calibration, limit 0.3 px" in shot.reasons[0]
    assert "self-calibrate" in shot.reasons[0]


def test_bad_images_are_named(truth: BrightScene) -> None:
    search = search_of(truth)
    broken = truth.images[1].copy()
    broken[3, 7] = np.nan
    with pytest.raises(ValueError, match=r"view 2: pixel \(column 7, row 3\) is nan"):
        measure_bright([truth.images[0], broken, *truth.images[2:]], search)
    with pytest.raises(ValueError, match="3 images for 4 views"):
        measure_bright(truth.images[:3], search)
    with pytest.raises(ValueError, match=r"view 1: its image has shape \(99, 240\)"):
        measure_bright([truth.images[0][:-1], *truth.images[1:]], search)


def test_voxels_must_be_about_as_wide_as_pixels(truth: BrightScene) -> None:
    coarse = VoxelGrid((20, 12, 40), GRID.origin_mm, 4 * GRID.pitch_mm)
    asked = (
        r"px wide: droplets are looked for with 0\.4 to 1\.3 px per voxel; leave the pitch out of the grid, or state"
    )
    with pytest.raises(ReconstructionError, match=asked):
        plan_droplets(truth.believed, coarse, margin_voxel=MARGIN_VOXEL)
    with pytest.raises(ReconstructionError, match=asked):
        plan_droplets(truth.believed, VoxelGrid((2, 2, 2), GRID.origin_mm, 300 * GRID.pitch_mm))


def test_a_grid_far_beyond_what_was_calibrated_is_not_sampled_in_vain(truth: BrightScene) -> None:
    """Nodes that are nearer to each other took minutes and gigabytes."""
    deep = VoxelGrid((60_000, 9, 9), (0.0, 0.0, -30_000 * GRID.pitch_mm), GRID.pitch_mm)
    with pytest.raises(RoughMapping, match=f"px within {_native.NODE_SPACINGS[0]} voxels"):
        plan_droplets(truth.believed, deep, margin_voxel=MARGIN_VOXEL)


def test_where_droplets_do_not_explain_the_images_nobody_is_sent_to_calibrate_again() -> None:
    beside_px, limits = {"view1": 0.6}, RatioLimits(trusted=1.05, refused=1.5)
    assert ["calibrate again" in reason for reason in judged(beside_px, 1.49, 9.0, limits)[1]] == [True]
    verdict, reasons = judged(beside_px, 1.5, 9.0, limits)
    assert verdict is ShotVerdict.REFUSED
    assert ["calibrate again" in reason for reason in reasons] == [False]


@pytest.mark.parametrize("ratio", [1.2, 1.6])
def test_images_whose_pixels_share_their_noise_are_asked_for(ratio: float) -> None:
    """Of images that were resampled, what is left is noise: neither calibration nor spray is to blame."""
    (reason,) = judged({"view1": 0.0}, ratio, 9.0, RatioLimits(trusted=1.05, refused=1.5))[1]
    assert "resampled" in reason


def test_what_a_view_does_not_see_is_not_empty(truth: BrightScene, shot: BrightExposure) -> None:
    """A box four times as wide as the images: number density is of what could be measured, and the shot says so."""
    wide = VoxelGrid.centred((*GRID.shape[:2], 4 * GRID.shape[2]), GRID.pitch_mm)
    search = plan_droplets(truth.believed, wide, margin_voxel=MARGIN_VOXEL)
    told = measure_bright(truth.images, search)
    seen_mm3 = (1 - told.hidden.volume_share) * wide.volume_mm3
    everywhere = np.stack([axis.ravel() for axis in np.meshgrid(wide.x_mm, wide.y_mm, wide.z_mm)], axis=1)
    inside = [
        np.all((px >= 0) & (px <= np.array(mapping.image_size_px) - 1), axis=1)
        for mapping in truth.believed
        for px in (mapping.project(everywhere),)
    ]
    assert seen_mm3 == pytest.approx(np.mean(np.all(inside, axis=0)) * wide.volume_mm3, rel=0.02)
    assert (shot.hidden.volume_share < 0.1, shot.verdict) == (True, "good")
    assert told.hidden.measured_percent
    percent = np.array(told.hidden.measured_percent["xy"])
    assert percent.mean() == pytest.approx(100 * (1 - told.hidden.volume_share), abs=1)
    assert (percent[:, [0, -1]] == 0).all(), "no view reaches as far"
    assert percent[len(percent) // 2, percent.shape[1] // 2] == 100
    assert told.verdict == "doubtful"
    assert "too few views see" in told.reasons[-1]
