"""Dots that are seen obliquely: distances by brute force, light by Abbe's sum of ellipses."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from processing.analysis.droplets.shadows.discs.coherent_discs import BLURS_PER_AIRY
from processing.analysis.droplets.shadows.discs.disc_profiles import disc_profiles
from processing.analysis.reticle.elliptic_dots import Ellipse, elliptic_dot
from processing.coherent_light import CORE_SIGMA
from tests.support.reticle_scenes import AIRY_PX, PER_AIRY, SIZE, ellipse_image

PLACES = (np.arange(SIZE) - SIZE // 2) / PER_AIRY


def test_distances_from_the_edge_are_those_to_its_nearest_point() -> None:
    ellipse = Ellipse(5.0, 3.4, 0.6)
    points = np.random.default_rng(1).uniform(-9, 9, (200, 2))
    turn = np.linspace(0, 2 * np.pi, 20_000)
    along, across = 5.0 * np.cos(turn), 3.4 * np.sin(turn)
    edge = np.column_stack([along * np.cos(0.6) - across * np.sin(0.6), along * np.sin(0.6) + across * np.cos(0.6)])
    nearest = np.min(np.linalg.norm(points[:, None] - edge, axis=2), axis=1)
    found = ellipse.beyond_edge_px(points)
    near = nearest < 3
    np.testing.assert_allclose(np.abs(found)[near], nearest[near], atol=5e-3)
    u, v = points @ [np.cos(0.6), np.sin(0.6)], points @ [-np.sin(0.6), np.cos(0.6)]
    np.testing.assert_array_equal(found < 0, (u / 5.0) ** 2 + (v / 3.4) ** 2 < 1)


@pytest.mark.parametrize("ratio", [0.8, 8.0])
@pytest.mark.parametrize("diameter_airy", [0.35, 1.0, 3.0])
@pytest.mark.parametrize("flat", [1.0, 0.71])
def test_a_dot_at_45_degrees_is_as_large_as_it_is(ratio: float, diameter_airy: float, flat: float) -> None:
    """Diameter and blur of the major axis, fitted to Abbe's sum; the share of the pixel is part of the blur."""
    radius = 0.5 * diameter_airy
    seen = ellipse_image((radius * flat, 0.0, 0.0, radius), None if ratio == 8 else ratio)
    u, v = np.meshgrid(PLACES, PLACES)
    near = np.hypot(u, v) < radius + 0.8
    points = np.column_stack([u[near], v[near]])
    blur = 1 / BLURS_PER_AIRY

    def left(unknown: "np.typing.NDArray[np.float64]") -> "np.typing.NDArray[np.float64]":
        major, width, level = unknown
        dot = Ellipse(major, flat * major, np.pi / 2)
        return np.asarray(level * elliptic_dot(disc_profiles(ratio), dot, width, points) - seen[near])

    major, width, level = least_squares(left, [0.9 * radius, blur, 1.0]).x
    assert major == pytest.approx(radius, rel=0.02)
    assert width == pytest.approx(np.hypot(CORE_SIGMA, 0.29 / AIRY_PX), rel=0.08)
    assert level == pytest.approx(1, abs=0.02)
