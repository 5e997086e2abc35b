"""Discs in partially coherent light: against Abbe's sum by an oracle, and their derivatives against differences."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from processing.analysis.droplets.shadows.coherent_discs import BLURS_PER_AIRY, CORE_SHARE, CORE_SIGMA, coherent_discs
from processing.analysis.droplets.shadows.disc_profiles import disc_profiles
from tests.support.abbe import PER_AIRY, SIZE, abbe

STEP = 1e-3


@pytest.mark.parametrize(("diameter_airy", "ratio"), [(0.15, 0.7), (0.5, 1.0), (0.8, 0.5), (1.5, 0.8)])
def test_a_disc_takes_the_light_that_abbes_sum_says(diameter_airy: float, ratio: float) -> None:
    pixel_and_defocus = CORE_SIGMA * np.sqrt(CORE_SHARE**-2 - 1) * PER_AIRY
    light = gaussian_filter(abbe([(0.0, 0.0, 0.5 * diameter_airy)], ratio), pixel_and_defocus)
    distances_airy = np.arange(SIZE // 2) / PER_AIRY
    near = distances_airy < 0.5 * diameter_airy + 1.0
    radius = np.array([0.5 * diameter_airy * BLURS_PER_AIRY])
    found = coherent_discs(ratio, radius, distances_airy[None, near] * BLURS_PER_AIRY)[0][0]
    along = light[SIZE // 2, SIZE // 2 :][near]
    np.testing.assert_allclose(1 - found, along, atol=6e-3)


def test_pull_and_growth_are_the_derivatives() -> None:
    radii = np.array([0.1, 0.9, 4.0, 20.0])
    distances = np.linspace(np.maximum(radii - 4, 0.3), radii + 4, 25, axis=1)
    larger, smaller = (np.sqrt(radii**2 + sign * STEP) for sign in (1, -1))
    rows = [(radii, 0.0), (radii, STEP), (radii, -STEP), (larger, 0.0), (smaller, 0.0)]
    places = np.concatenate([distances + step for _, step in rows])
    taken, pull, growth = coherent_discs(0.8, np.concatenate([row for row, _ in rows]), places)
    _, out, inward, grown, shrunk = taken.reshape(len(rows), *distances.shape)
    for change, expected in zip(pull, (inward - out) / (2 * STEP) / distances, strict=False):
        np.testing.assert_allclose(change, expected, atol=2e-3 * np.abs(change).max())
    for change, expected in zip(growth, (grown - shrunk) / (2 * STEP), strict=False):
        np.testing.assert_allclose(change, expected, atol=5e-3 * np.abs(change).max())


def test_the_edge_of_a_large_disc_lies_farther_out_than_in_incoherent_light() -> None:
    """A straight edge lets a quarter of the light through where it is, fully coherent, and half of it incoherent."""
    (shift, width), (other_shift, other_width) = (disc_profiles(ratio).edge for ratio in (None, 0.3))
    assert shift == pytest.approx(0, abs=0.04)
    assert width == pytest.approx(1, abs=0.01)
    assert other_shift > 0.4
    assert other_width < 0.8
