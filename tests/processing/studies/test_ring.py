"""Profiles of rings whose radius, width and flanks are known."""

import numpy as np
import pytest

from processing.studies.ring import SMOOTHING_MM, RadialProfile, radial_profile

AXIS_MM = np.linspace(-4, 4, 401)


def ring(radius_mm: float, sigma_mm: float) -> RadialProfile:
    radii_mm = np.hypot(AXIS_MM[None, :], AXIS_MM[:, None])
    return radial_profile(7 * np.exp(-((radii_mm - radius_mm) ** 2) / (2 * sigma_mm**2)), AXIS_MM, AXIS_MM, 0.02)


@pytest.mark.parametrize("sigma_mm", [0.1, 0.2, 0.4])
def test_a_gaussian_ring_has_its_width_and_its_gradients(sigma_mm: float) -> None:
    profile = ring(2.0, sigma_mm)
    assert profile.ring_mm == pytest.approx(2.0, abs=0.02)
    assert profile.width_mm == pytest.approx(2.355 * sigma_mm, rel=0.02)
    smoothed_mm = np.hypot(sigma_mm, SMOOTHING_MM)
    steepest = profile.intensities.max() * np.exp(-0.5) * sigma_mm / smoothed_mm**2
    assert profile.inner_gradient_per_mm == pytest.approx(steepest, rel=0.03)
    assert profile.outer_gradient_per_mm == pytest.approx(steepest, rel=0.03)


def test_the_same_liquid_in_a_narrower_ring_is_higher_and_steeper() -> None:
    narrow, wide = ring(2.0, 0.1), ring(2.0, 0.2)
    assert narrow.intensities.max() == pytest.approx(2 * wide.intensities.max(), rel=0.01)
    assert narrow.outer_gradient_per_mm > 2.5 * wide.outer_gradient_per_mm


def test_evenly_spread_liquid_is_one_everywhere() -> None:
    even = radial_profile(np.full((401, 401), 3.0), AXIS_MM, AXIS_MM, 0.02)
    np.testing.assert_allclose(even.intensities, 1)


def test_noise_in_the_few_voxels_of_the_middle_is_not_the_flank() -> None:
    clean = ring(2.0, 0.2)
    noisy = clean.intensities.copy()
    noisy[::2][:20] = 0.9 * noisy.max()
    assert RadialProfile(clean.radii_mm, noisy).inner_gradient_per_mm == clean.inner_gradient_per_mm


def test_corners_do_not_count() -> None:
    assert ring(2.0, 0.2).radii_mm[-1] == pytest.approx(4.0)


def test_a_slope_without_half_maxima_is_as_wide_as_the_profile() -> None:
    profile = RadialProfile(np.array([0.0, 1.0, 2.0]), np.array([0.8, 1.0, 0.9]))
    assert profile.width_mm == 2.0
