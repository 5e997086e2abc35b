"""Discs in the light of a lens: against Abbe's sum by an oracle, and their derivatives against differences."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from scipy.special import j1

from processing.analysis.droplets.shadows.discs.coherent_discs import BLURS_PER_AIRY, CORE_SHARE, coherent_discs
from processing.analysis.droplets.shadows.discs.disc_profiles import disc_profiles
from processing.coherent_light import CORE_SIGMA, circles, waves
from tests.support.abbe import PER_AIRY, SIZE, abbe

STEP = 1e-3


@pytest.mark.parametrize(
    ("diameter_airy", "ratio"), [(0.15, 0.7), (0.5, 1.0), (0.8, 0.5), (1.5, 0.8), (0.6, 1.4), (1.2, 2.0)]
)
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


def test_light_from_all_directions_is_the_spread_of_a_point_added_up() -> None:
    """Airy's pattern, ``(2 J1(x) / x)^2``, summed over the points of a disc, and what lies between is as between."""
    radius_airy, points = 0.6, np.linspace(-2, 2, 401)
    x, y = np.meshgrid(points, points)
    far = np.pi * 2.44 * np.hypot(x, y) + 1e-12
    spread = (2 * j1(far) / far) ** 2
    spread *= np.diff(points)[0] ** 2 * (np.pi * 2.44) ** 2 / (4 * np.pi)
    taken = [spread[np.hypot(x - at, y) < radius_airy].sum() for at in (0.0, 0.4, 0.6, 0.9)]
    rings = circles()
    found = [
        -(rings.spectrum(2 * radius_airy, ratio) @ waves(rings.per_airy, np.array([0, 0.4, 0.6, 0.9])))
        for ratio in (8.0, 4.0, 2.0)
    ]
    np.testing.assert_allclose(found[0], taken, atol=8e-3)
    errors = [np.abs(row - found[0]).max() for row in found]
    assert errors[0] < errors[1] < errors[2] < 0.06


def test_the_edge_of_a_large_disc_lies_farther_out_than_behind_a_gaussian_blur() -> None:
    """A straight edge lets a quarter of the light through where it is, fully coherent, and half of it incoherent."""
    (shift, width), (other_shift, other_width) = (disc_profiles(ratio).edge for ratio in (None, 0.3))
    assert shift == pytest.approx(0, abs=0.04)
    assert width == pytest.approx(1, abs=0.01)
    assert other_shift > 0.4
    assert other_width < 0.8
