"""Opaque discs unite before they are blurred: against a finely sampled mask, and against the noncentral chi-square."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.stats import ncx2

from processing.studies.simulated_droplets import study_cameras
from processing.synthetic.paper_rig import paper_optics
from processing.synthetic.rendering import depth_out_of_focus_mm
from processing.synthetic.stamping import Discs, FloatArray, stamp_discs
from processing.synthetic.union import ACCURATE, QUICK, blurred_union

SHAPE = (40, 44)
FINE = 8
OPTICS = paper_optics()


def discs(
    centres: list[list[float]], radii_px: list[float], sigmas_px: float = 0.0, smear: tuple[float, float] = (0, 0)
) -> Discs:
    count = len(radii_px)
    return Discs(
        np.array(centres), np.array(radii_px), np.full(count, sigmas_px), np.ones(count), np.tile(smear, (count, 1))
    )


def mask_of(some: Discs, shape: tuple[int, int], fine: int = FINE) -> NDArray[np.bool_]:
    """Where the sharp discs are, on fine pixels."""
    rows, columns = ((np.arange(fine * size) + 0.5) / fine - 0.5 for size in shape)
    mask = np.zeros((len(rows), len(columns)), bool)
    for (row, column), radius_px in zip(some.centres, some.radii_px, strict=True):
        near = [
            slice(*np.searchsorted(axis, [c - radius_px, c + radius_px]))
            for axis, c in ((rows, row), (columns, column))
        ]
        distances = np.hypot((rows[near[0]] - row)[:, None], columns[near[1]] - column)
        mask[near[0], near[1]] |= distances < radius_px
    return mask


def on_pixels(mask: NDArray[np.floating] | NDArray[np.bool_], blur_px: float, fine: int = FINE) -> FloatArray:
    """Transmittance of a fine mask, blurred, over the area of each pixel."""
    blurred = gaussian_filter(mask.astype(np.float32), blur_px * fine, truncate=5, mode="constant")
    rows, columns = (size // fine for size in mask.shape)
    return np.asarray(1 - blurred.reshape(rows, fine, columns, fine).mean(axis=(1, 3)), dtype=np.float64)


def expected(some: Discs, blur_px: float, shape: tuple[int, int] = SHAPE) -> FloatArray:
    return on_pixels(mask_of(some, shape), blur_px)


SUB_PIXEL = st.tuples(st.floats(18, 20), st.floats(20, 23))


@given(SUB_PIXEL, st.floats(0.3, 6), st.floats(0.15, 2))
@settings(max_examples=60)
def test_area_is_that_of_the_disc_wherever_it_lies(
    centre: tuple[float, float], radius_px: float, blur_px: float
) -> None:
    light = blurred_union(discs([list(centre)], [radius_px]), blur_px, SHAPE)
    assert (1 - light).sum(dtype=float) == pytest.approx(np.pi * radius_px**2, rel=1e-3)


@given(SUB_PIXEL, st.floats(0.3, 6), st.floats(0.65, 2), st.floats(0, 1.5))
@settings(max_examples=40)
def test_isolated_disc_is_a_noncentral_chi_square(
    centre: tuple[float, float], radius_px: float, blur_px: float, defocus_px: float
) -> None:
    light = blurred_union(discs([list(centre)], [radius_px], defocus_px), blur_px, SHAPE)
    nodes, weights = np.polynomial.legendre.leggauss(5)
    row, column = np.indices(SHAPE, float)
    sigma_px = np.hypot(blur_px, defocus_px)
    shadow = sum(
        0.25
        * wy
        * wx
        * ncx2.cdf(
            (radius_px / sigma_px) ** 2,
            2,
            ((row + 0.5 * ny - centre[0]) ** 2 + (column + 0.5 * nx - centre[1]) ** 2) / sigma_px**2,
        )
        for ny, wy in zip(nodes, weights, strict=True)
        for nx, wx in zip(nodes, weights, strict=True)
    )
    np.testing.assert_allclose(light, 1 - np.asarray(shadow), atol=2e-3)


@pytest.mark.parametrize("blur_px", [0.65, 0.9])
@pytest.mark.parametrize("distance_px", [1.0, 3.0, 4.5, 6.0, 8.0])
def test_two_discs_are_their_blurred_union(distance_px: float, blur_px: float) -> None:
    two = discs([[19.3, 19.6], [19.3 + 0.6 * distance_px, 19.6 + 0.8 * distance_px]], [4.2, 2.1])
    light, truth = blurred_union(two, blur_px, SHAPE), expected(two, blur_px)
    assert np.abs(light - truth).max() < 0.03
    assert np.sqrt(np.mean((light - truth) ** 2)) < 1.5e-3


def test_product_of_shadows_is_no_union() -> None:
    two = discs([[19.3, 19.6], [22.0, 22.0]], [4.2, 2.1], 0.9)
    product = stamp_discs(two, SHAPE)
    assert np.abs(product - expected(two, 0.9)).max() > 0.07


@pytest.mark.parametrize("smear", [(0.0, 0.0), (0.5, 1.4)])
def test_a_disc_behind_a_larger_one_changes_nothing(smear: tuple[float, float]) -> None:
    front = discs([[19.3, 19.6]], [6.0], smear=smear)
    both = discs([[19.3, 19.6], [20.1, 18.4]], [6.0, 2.5], smear=smear)
    np.testing.assert_allclose(blurred_union(both, 0.9, SHAPE), blurred_union(front, 0.9, SHAPE), atol=1e-4)


def test_the_order_of_discs_says_nothing() -> None:
    rng = np.random.default_rng(0)
    some = discs(rng.uniform(5, 35, (40, 2)).tolist(), rng.uniform(0.5, 4, 40).tolist(), 0.4, (0.3, 1.0))
    shuffled = some.select(rng.permutation(40))
    np.testing.assert_allclose(blurred_union(some, 0.8, SHAPE), blurred_union(shuffled, 0.8, SHAPE), atol=1e-6)


@pytest.mark.parametrize("centre", [[-3.0, 10.0], [0.2, 0.4], [39.0, 43.4], [41.0, 45.0]])
def test_border_cuts_a_disc_and_nothing_else(centre: list[float]) -> None:
    cut = blurred_union(discs([centre], [4.0]), 0.9, SHAPE)
    whole = blurred_union(discs([[centre[0] + 20, centre[1] + 20]], [4.0]), 0.9, (80, 84))
    np.testing.assert_allclose(cut, whole[20:60, 20:64], atol=1e-6)
    assert cut.min() < 0.9


def test_nothing_in_sight_is_full_light() -> None:
    for nothing in (discs([[500.0, -40.0]], [4.0]), discs([[0.0, 0.0]], [1.0]).select(np.arange(0))):
        assert blurred_union(nothing, 0.9, SHAPE).min() == 1


def test_discs_that_fly_together_stay_united() -> None:
    """The pulse shows all discs at the same times: their union moves, not each shadow by itself."""
    path_px = np.array([0.9, 1.5])
    two = discs([[19.3, 19.6], [21.0, 23.4]], [3.0, 2.0], smear=tuple(path_px))
    times = (np.arange(24) + 0.5) / 24 - 0.5
    moved = [replace(two, centres=two.centres + time * path_px) for time in times]
    truth = on_pixels(np.mean([mask_of(at_time, SHAPE) for at_time in moved], axis=0), 0.8)
    np.testing.assert_allclose(blurred_union(two, 0.8, SHAPE), truth, atol=0.015)


def rms(difference: NDArray[np.floating]) -> float:
    return float(np.sqrt(np.mean(difference**2)))


def slab(count: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Droplets (N, 3) in mm and their diameters, in 500 x 100 x 250 voxels at 60 per mm."""
    positions_mm = rng.uniform(-0.5, 0.5, (count, 3)) * np.array([500, 100, 250]) / 60
    return positions_mm, np.clip(rng.lognormal(np.log(0.04), 0.4, count), 0.01, None)


@pytest.mark.parametrize(("count", "rms_of_product"), [(400, 0.0034), (800, 0.0066), (1600, 0.0125)])
def test_what_multiplied_shadows_get_wrong(count: int, rms_of_product: float) -> None:
    """7, 14, 28 droplets per mm^3 of 40 um: rms in parts of the background."""
    positions_mm, diameters_mm = slab(count, np.random.default_rng(2))
    camera, blur_px, shape = study_cameras((600, 160))[0], OPTICS["view1"].diffraction_sigma_px, (160, 600)
    sharp = discs(camera.project(positions_mm)[:, ::-1].tolist(), (30 * diameters_mm).tolist())
    truth, union = expected(sharp, blur_px, shape), blurred_union(sharp, blur_px, shape)
    product = stamp_discs(replace(sharp, sigmas_px=np.full(count, np.hypot(blur_px, 12**-0.5))), shape)
    assert rms(product - truth) == pytest.approx(rms_of_product, rel=0.4)
    assert rms(union - truth) < 0.2 * rms(product - truth)


def ray_traced(some: Discs, defocus_px: FloatArray, blur_px: float, shape: tuple[int, int]) -> FloatArray:
    """Each of 48 rays of the aperture meets all discs where it passes their depths."""
    k = np.arange(48) + 0.5
    rays = np.sqrt(-2 * np.log(1 - k / 48)) * np.exp(1j * k * np.pi * (3 - 5**0.5))
    rays -= rays.mean()
    rays *= np.sqrt(2 / np.mean(np.abs(rays) ** 2))
    offsets = [np.column_stack([ray.real * defocus_px, ray.imag * defocus_px]) for ray in rays]
    masks = [mask_of(replace(some, centres=some.centres + offset), shape) for offset in offsets]
    return on_pixels(np.asarray(np.mean(masks, axis=0, dtype=np.float32)), blur_px)


def test_defocus_against_traced_rays() -> None:
    """28 droplets per mm^3 through 4 mm of depth, the focus in its middle."""
    shape, optics, inside = (64, 100), OPTICS["view1"], np.s_[8:-8, 8:-8]
    camera = study_cameras(shape[::-1])[0]
    positions_mm, diameters_mm = slab(1600, np.random.default_rng(2))
    visible = np.all(np.abs(camera.project(positions_mm) - [49.5, 31.5]) < [65, 46], axis=1)
    positions_mm, diameters_mm = positions_mm[visible], diameters_mm[visible]
    depths_mm = depth_out_of_focus_mm(camera, positions_mm)
    defocus_px = np.copysign(optics.defocus_sigma_px(depths_mm), depths_mm)
    some = discs(camera.project(positions_mm)[:, ::-1].tolist(), (30 * diameters_mm).tolist())
    truth = ray_traced(some, defocus_px, optics.diffraction_sigma_px, shape)[inside]
    product = stamp_discs(replace(some, sigmas_px=optics.blur_sigma_px(depths_mm)), shape)
    quick, accurate = (
        blurred_union(replace(some, sigmas_px=defocus_px), optics.diffraction_sigma_px, shape, sampling)
        for sampling in (QUICK, ACCURATE)
    )
    assert rms(product[inside] - truth) > 0.015
    assert rms(quick[inside] - truth) < 0.35 * rms(product[inside] - truth)
    assert rms(accurate[inside] - truth) < 0.08 * rms(product[inside] - truth)


@pytest.mark.parametrize("defocus_px", [0.3, -0.9, 2.5])
def test_rays_add_up_to_the_defocus_of_a_lone_disc(defocus_px: float) -> None:
    lone = discs([[19.3, 19.6]], [1.1], defocus_px)
    quick, accurate = (blurred_union(lone, 0.9, SHAPE, sampling) for sampling in (QUICK, ACCURATE))
    np.testing.assert_allclose(accurate, quick, atol=3e-3)
