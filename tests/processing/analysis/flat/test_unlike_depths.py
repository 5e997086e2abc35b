"""Droplets of an image that are paler than the others: of a blended frame, or far out of focus."""

import numpy as np
import pytest
from numpy.typing import NDArray

from processing.analysis.flat.flat_doubts import flat_doubts
from processing.analysis.flat.flat_droplets import FlatDroplets, measure_flat
from processing.analysis.flat.flat_settings import FlatSettings
from tests.support.flat_scenes import PLACES, noisy, out_of_focus, seen, spread_discs


def doubts(image: NDArray[np.floating], bright: bool = False) -> tuple[str, FlatDroplets]:
    found = measure_flat(image, FlatSettings(polarity="bright") if bright else None)
    return " | ".join(flat_doubts(found)), found


@pytest.mark.parametrize("share", [0.25, 0.4])
def test_two_frames_that_were_blended_are_doubted(share: float) -> None:
    """Of two frames of 80 droplets 141 were told."""
    moved = spread_discs(0.95, aside_px=17.0, some=slice(17))
    said, found = doubts(noisy((1 - share) * seen(spread_discs()) + share * seen(moved)))
    assert len(found) > len(PLACES)
    assert "are two frames blended" in said


def test_large_droplets_far_out_of_focus_are_doubted() -> None:
    """They were told twice as large as they are."""
    behind = out_of_focus([(x, y, 9.5) for x, y in PLACES[::4]])
    near = [disc for index, disc in enumerate(spread_discs()) if index % 4]
    said, found = doubts(noisy(seen(near) * behind))
    assert len(found) > len(near)
    assert "are far out of focus behind a round pupil" in said


def test_bright_particles_of_two_sizes_have_two_brightnesses() -> None:
    small = seen([(x, y, 8.0) for x, y in PLACES[:12]], depth=0.4)
    large = seen([(x, y, 16.0) for x, y in PLACES[12:]])
    said, found = doubts(noisy(1.05 - small * large), bright=True)
    assert said == ""
    assert len(found) == len(PLACES)
