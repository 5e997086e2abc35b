"""The disc kernels against float64 numpy and scipy."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import ncx2

from processing.analysis.droplets.shadows.discs.disc_profiles import OPACITY, opacity
from processing.analysis.droplets.shadows.discs.opaque_discs import DiscImages, DiscOptics, Discs, Sweeps
from processing.analysis.droplets.sight_lattice import sight_lattice
from processing.geometry import FloatArray
from processing.studies.simulated_droplets import study_cameras, study_grid
from tests.support.shadow_scenes import scale_px_per_mm

Pixels = NDArray[np.floating[Any]]
IMAGE_SIZE_PX = (240, 100)
GRID = study_grid((80, 40, 160))
CAMERAS = study_cameras(IMAGE_SIZE_PX)
LATTICE = sight_lattice(CAMERAS, GRID)
MIDDLE = 40.0
OPTICS = DiscOptics(
    variances_px2=np.array(
        [[0.9, 0, 0], [0.5 + MIDDLE**2 * 1e-4, -2 * MIDDLE * 1e-4, 1e-4], [0.6, 0, 0], [2.0, 0.005, 0]]
    ),
    shifts_px=np.array([[0.1, 0], [0, -0.2], [0.05, 0.05], [0, 0]]),
    levels=np.ones(4),
)


def discs(count: int = 25, seed: int = 0, beyond: float = 20) -> Discs:
    rng = np.random.default_rng(seed)
    positions = rng.uniform(-beyond, np.array(GRID.shape[::-1]) + beyond, (count, 3))
    return Discs(positions, rng.lognormal(0.2, 0.8, count) ** 2)


def shot_of(images: Sequence[Pixels], weight: float = 1e4) -> DiscImages:
    return DiscImages(
        tuple(np.asarray(image, dtype=np.float32) for image in images),
        tuple(np.full(IMAGE_SIZE_PX[::-1], weight, np.float32) for _ in images),
        LATTICE,
    )


EMPTY = shot_of([np.ones(IMAGE_SIZE_PX[::-1]) for _ in CAMERAS])


def drawn_by_scipy(view: int, some: Discs) -> FloatArray:
    rows, columns = np.mgrid[: IMAGE_SIZE_PX[1], : IMAGE_SIZE_PX[0]]
    points_mm = GRID.to_mm(some.positions_voxel[:, ::-1])
    radii_px = some.radii_voxel * GRID.pitch_mm * scale_px_per_mm(CAMERAS[view], points_mm)
    image = np.ones(rows.shape)
    places = CAMERAS[view].project(points_mm) + OPTICS.shifts_px[view]
    z_voxel = some.positions_voxel[:, 2]
    constant, slope, bend = OPTICS.variances_px2[view]
    blurs_px = np.sqrt(constant + slope * z_voxel + bend * z_voxel**2)
    for (u, v), radius_px, blur_px in zip(places, radii_px, blurs_px, strict=True):
        distances = np.hypot(columns - u, rows - v) / blur_px
        near = distances < radius_px / blur_px + 8
        image[near] *= 1 - OPACITY * ncx2.cdf((radius_px / blur_px) ** 2, 2, distances[near] ** 2)
    return image


def test_the_opacity_of_a_disc_is_a_probability_of_scipy() -> None:
    radii, distances = np.meshgrid([0.1, 0.5, 1.3, 4.0, 20.0], [0.01, 0.7, 1.5, 4.1, 19.0, 22.0])
    np.testing.assert_allclose(opacity(radii, distances), ncx2.cdf(radii**2, 2, distances**2), atol=1e-6)


def test_discs_are_drawn_where_the_cameras_see_them_also_at_the_edges() -> None:
    some = discs()
    for view, image in enumerate(EMPTY.drawn(OPTICS, some).transmissions):
        expected = drawn_by_scipy(view, some)
        np.testing.assert_allclose(image, expected, atol=0.03)  # a lattice is known to 0.01 px, edges are steep
        assert np.sqrt(np.mean((image - expected) ** 2)) < 1.5e-3
        assert image.min() < 0.1


def test_what_is_drawn_and_taken_away_leaves_nothing() -> None:
    shadows = EMPTY.drawn(OPTICS, discs())
    EMPTY.add(shadows, OPTICS, discs(), -1.0)
    assert max(np.abs(image).max() for image in shadows.logs) < 1e-5


def test_sums_are_those_of_numerical_derivatives() -> None:
    one, step = Discs(np.array([[80.2, 20.4, 40.7]]), np.array([1.7])), 1e-2
    full = shot_of([image - 0.05 for image in EMPTY.drawn(OPTICS, one).transmissions])
    shadows = full.drawn(OPTICS, one)
    supports = full.supports(shadows, OPTICS, one)

    def change(other: Discs, optics: DiscOptics = OPTICS) -> list[Pixels]:
        with_step = full.drawn(optics, other).transmissions
        return [(a - b).ravel() / step for a, b in zip(with_step, shadows.transmissions, strict=True)]

    shifted = [replace(OPTICS, shifts_px=OPTICS.shifts_px + step * np.eye(2)[axis]) for axis in (0, 1)]
    along_u, along_v = (change(one, optics) for optics in shifted)
    growth = change(replace(one, squares_voxel2=one.squares_voxel2 + step))
    for view in range(len(CAMERAS)):
        jacobian = np.array([along_u[view], along_v[view], growth[view]], dtype=np.float64)
        uu, uv, us, vv, vs, ss = (1e4 * jacobian @ jacobian.T)[np.triu_indices(3)]
        largest = max(uu, vv, ss)
        np.testing.assert_allclose(supports.sums[view, 0, :6], [uu, uv, vv, us, vs, ss], atol=0.03 * largest)
    slopes = LATTICE.slopes_px(one.positions_voxel)
    information = supports.information(slopes)[0]
    moved = [change(replace(one, positions_voxel=one.positions_voxel + step * np.eye(3)[axis])) for axis in range(3)]
    numerical = np.array([np.concatenate(parts) for parts in (*moved, growth)], dtype=np.float64)
    np.testing.assert_allclose(information, 1e4 * numerical @ numerical.T, atol=0.03 * information.max())


def test_what_a_view_alone_would_say_of_a_size_is_its_truth() -> None:
    true, half = Discs(np.array([[80.2, 20.4, 40.7]]), np.array([1.5])), np.array([0.75])
    full = shot_of(EMPTY.drawn(OPTICS, true).transmissions)
    small = replace(true, squares_voxel2=half)
    alone = full.supports(full.drawn(OPTICS, small), OPTICS, small).alone
    np.testing.assert_allclose(alone[:, 0], 1.5, rtol=0.15)


def test_views_that_disagree_say_so_and_views_that_agree_leave_the_noise_alone() -> None:
    true = Discs(np.array([[80.2, 20.4, 40.7]]), np.array([1.5]))
    images = EMPTY.drawn(OPTICS, true).transmissions
    agreed = shot_of(images)
    assert agreed.supports(agreed.drawn(OPTICS, true), OPTICS, true).disagreement == pytest.approx(1.0)
    other = EMPTY.drawn(OPTICS, Discs(true.positions_voxel, np.array([1.65]))).transmissions
    disputed = shot_of([other[0], *images[1:]])
    supports = disputed.supports(disputed.drawn(OPTICS, true), OPTICS, true)
    expected = 0.15 / supports.alone_sd[0, 0] / np.sqrt(3)
    assert expected > 2
    assert supports.disagreement == pytest.approx(expected, rel=0.2)  # shadows are compared as wholes, not edges


def test_noise_counts_as_much_as_its_pixels_tell_the_place() -> None:
    one, step, rng = Discs(np.array([[80.3, 20.1, 40.2]]), np.array([4.0])), 0.01, np.random.default_rng(3)
    plain = EMPTY.drawn(OPTICS, one).transmissions
    noise = [rng.normal(0, 0.01 * np.sqrt(image)) for image in plain]  # light that is counted: less of it, less noise
    seen = shot_of([image + one for image, one in zip(plain, noise, strict=True)])
    shifts = (replace(OPTICS, shifts_px=OPTICS.shifts_px + step * np.eye(2)[axis]) for axis in (0, 1))
    moved = [EMPTY.drawn(shifted, one).transmissions for shifted in shifts]
    telling = np.array([sum((axis[k] - plain[k]) ** 2 for axis in moved) for k in range(len(plain))])
    expected = np.sqrt(np.sum(telling * 1e4 * np.array(noise) ** 2) / np.sum(telling))
    supports = seen.supports(seen.drawn(OPTICS, one), OPTICS, one)
    assert supports.place_noise == pytest.approx(expected, rel=0.02)
    assert expected < 0.85 < supports.residual


def test_the_truth_is_a_fixed_point_of_the_fit() -> None:
    some = discs(beyond=-15)
    full = shot_of(EMPTY.drawn(OPTICS, some).transmissions)
    fitted, information = full.fitted(full.drawn(OPTICS, some), OPTICS, some, Sweeps(5, tolerance=0))
    np.testing.assert_allclose(fitted.positions_voxel, some.positions_voxel, atol=1e-3)
    np.testing.assert_allclose(fitted.radii_voxel, some.radii_voxel, atol=1e-3)
    assert np.all(information > 0)


def test_a_fit_from_nearby_comes_to_the_truth_and_keeps_the_shadows_up_to_date() -> None:
    rng = np.random.default_rng(3)
    true = Discs(rng.uniform(10, 30, (6, 3)) * [4, 1, 2], rng.uniform(0.5, 2, 6) ** 2)
    full = shot_of(EMPTY.drawn(OPTICS, true).transmissions)
    start = Discs(true.positions_voxel + rng.uniform(-0.5, 0.5, (6, 3)), 0.5 * true.squares_voxel2)
    shadows = full.drawn(OPTICS, start)
    fitted, _ = full.fitted(shadows, OPTICS, start, Sweeps(200, tolerance=0))
    np.testing.assert_allclose(fitted.positions_voxel, true.positions_voxel, atol=0.01)
    np.testing.assert_allclose(fitted.radii_voxel, true.radii_voxel, rtol=0.01)
    for log, image in zip(shadows.logs, full.drawn(OPTICS, fitted).logs, strict=True):
        np.testing.assert_allclose(log, image, atol=1e-4)


def test_pixels_of_no_weight_do_not_matter() -> None:
    true = Discs(np.array([[80.0, 20.0, 40.0]]), np.array([4.0]))
    full = shot_of(EMPTY.drawn(OPTICS, true).transmissions)
    spoilt = [image.copy() for image in full.images]
    trusted = [weight.copy() for weight in full.weights]
    for image, weight in zip(spoilt, trusted, strict=True):
        image[::7], weight[::7] = 5.0, 0.0
    shot = DiscImages(tuple(spoilt), tuple(trusted), LATTICE)
    start = Discs(true.positions_voxel + 0.3, true.squares_voxel2 * 0.8)
    fitted, _ = shot.fitted(shot.drawn(OPTICS, start), OPTICS, start, Sweeps(60, tolerance=0))
    np.testing.assert_allclose(fitted.positions_voxel, true.positions_voxel, atol=0.01)


def test_what_is_far_away_or_no_number_harms_nothing() -> None:
    for place in (1e300, -1e9, np.nan):
        lost = Discs(np.full((1, 3), place), np.ones(1))
        for log in EMPTY.drawn(OPTICS, lost).logs:
            assert not log.any()


def test_kernels_refuse_optics_that_are_none() -> None:
    with pytest.raises(ValueError, match="finite numbers"):
        EMPTY.drawn(replace(OPTICS, variances_px2=np.full((4, 3), np.nan)), discs())
