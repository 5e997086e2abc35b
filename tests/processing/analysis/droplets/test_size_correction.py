"""Corrections by a reticle: exact at its dots, between them in between, and less sure beyond them."""

import numpy as np

from processing.analysis.droplets.size_correction import SizeCorrection

SIZES = SizeCorrection.of(((27.0, 20.0, 1.0), (106.0, 100.0, 2.0)))


def test_a_dot_gets_its_own_diameter() -> None:
    np.testing.assert_allclose(SIZES.corrected(np.array([27.0, 106.0])), [20, 100])
    np.testing.assert_allclose(SIZES.sd(np.array([27.0, 106.0])), [1, 2])


def test_what_lies_between_keeps_its_order() -> None:
    diameters_um = np.linspace(5, 300, 60)
    assert np.all(np.diff(SIZES.corrected(diameters_um)) > 0)
    np.testing.assert_allclose(SIZES.corrected(np.array([66.5])), [60])


def test_beyond_the_dots_the_last_difference_holds_and_half_of_it_is_unsure() -> None:
    np.testing.assert_allclose(SIZES.corrected(np.array([15.0, 206.0])), [8, 200])
    np.testing.assert_allclose(SIZES.sd(np.array([15.0, 206.0])), [np.hypot(1, 3.5), np.hypot(2, 3)])


def test_no_droplet_vanishes_however_small_beside_the_dots() -> None:
    """Dots of 30 um that look like 42 say little of droplets that look like 10."""
    sizes = SizeCorrection.of(((42.0, 30.0, 1.0), (112.0, 100.0, 1.0)))
    diameters_um = np.linspace(1, 42, 42)
    assert np.all(sizes.corrected(diameters_um) >= 0.5 * diameters_um)
    assert np.all(np.diff(sizes.corrected(diameters_um)) > 0)
