"""Balls that shine throughout, beside discs with a glare, and behind blurs of their own."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from processing.analysis.flat.flat_doubts import flat_doubts
from processing.analysis.flat.flat_droplets import FlatDroplets, measure_flat
from processing.analysis.flat.flat_settings import FlatSettings
from tests.support.flat_scenes import SHAPE, SIZES_PX, Disc, noisy, seen, spread_discs


def balls(discs: list[Disc]) -> NDArray[np.float64]:
    """As bright as they are deep."""
    rows, columns = np.ogrid[: SHAPE[0], : SHAPE[1]]
    light = np.zeros(SHAPE)
    for x_px, y_px, diameter_px in discs:
        radii = np.hypot(rows - y_px, columns - x_px) / (diameter_px / 2)
        light += np.sqrt(np.clip(1 - radii**2, 0, None))
    return np.asarray(gaussian_filter(light, 0.8), np.float64)


def doubts(image: NDArray[np.floating]) -> tuple[str, FlatDroplets]:
    found = measure_flat(image, FlatSettings(polarity="bright"))
    return " | ".join(flat_doubts(found)), found


def test_balls_that_shine_throughout_are_doubted() -> None:
    """Half of their brightness lies within: they were told 13 % too small, and good."""
    said, found = doubts(noisy(0.05 + balls(spread_discs())))
    assert np.mean(found.diameters_px) < 0.9 * np.mean(SIZES_PX)
    assert "the softer the larger they are" in said


def test_discs_with_a_glare_or_behind_blurs_of_their_own_are_not() -> None:
    glare = 1 - seen(spread_discs(0.35), depth=0.8)
    assert doubts(noisy(1.05 - seen(spread_discs()) - glare))[0] == ""
    near = seen(spread_discs(some=slice(0, None, 2)), blur_px=0.8)
    far = seen(spread_discs(some=slice(1, None, 2)), blur_px=2.0)
    assert doubts(noisy(1.05 - near * far))[0] == ""
