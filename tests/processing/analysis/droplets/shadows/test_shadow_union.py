"""The union of discs against masks of many samples per pixel."""

import numpy as np
import pytest

from processing.analysis.droplets.shadows.discs.disc_profiles import OPACITY
from processing.analysis.droplets.shadows.shadow_union import united
from processing.kernels import _native
from tests.support.shadow_scenes import united_shadow


@pytest.mark.parametrize("blur_px", [0.6, 0.95, 1.5])
def test_discs_unite_as_masks_do(blur_px: float) -> None:
    rng = np.random.default_rng(0)
    centres, radii = rng.uniform(-3, 103, (60, 2)), rng.uniform(0.3, 7, 60)
    expected = 1 - OPACITY * (1 - united_shadow(centres, radii, blur_px, (100, 90)))
    inside = np.s_[5:-5, 5:-5]  # at the edges of an image light from beyond is missing in both
    error = (united(centres, radii, blur_px, (90, 100)) - expected)[inside]
    assert np.abs(error).max() < (0.02 if blur_px < 0.8 else 0.005)
    assert np.sqrt(np.mean(error**2)) < 1.5e-3


@pytest.mark.parametrize("radius_px", [0.05, 0.3, 1.2, 7.0])
def test_the_area_of_a_disc_is_exact_wherever_it_lies(radius_px: float) -> None:
    for centre in np.random.default_rng(1).uniform(20, 30, (20, 2)):
        cells = np.empty((100, 100), np.float32)
        _native.cover(centre[None], np.array([radius_px]), cells)
        assert cells.sum() / _native.COVERAGE_CELLS**2 == pytest.approx(np.pi * radius_px**2, rel=1e-4)


def test_what_lies_within_another_disc_adds_nothing() -> None:
    centres, radii = np.array([[30.2, 29.7], [31.0, 30.0]]), np.array([6.0, 2.0])
    one, both = (np.empty((120, 120), np.float32) for _ in range(2))
    _native.cover(centres[:1], radii[:1], one)
    _native.cover(centres, radii, both)
    np.testing.assert_array_equal(one, both)


def test_discs_beyond_the_image_or_no_numbers_cover_nothing() -> None:
    cells = np.ones((100, 100), np.float32)
    _native.cover(np.array([[-9.0, 5], [1e9, 5], [5, -1e300], [np.nan, 5], [5, np.inf]]), np.full(5, 3.0), cells)
    assert not cells.any()
