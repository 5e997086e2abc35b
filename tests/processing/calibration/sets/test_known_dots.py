"""Dots of a solid target are found among hidden dots and bright specks."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from processing.calibration.errors import TargetNotFound
from processing.calibration.sets.known_dots import find_known_dots
from processing.geometry import FloatArray, view_camera

CAMERA = view_camera(20.0, focal_length_mm=70.0, magnification=0.12, scale_px_per_mm=8.0, image_size_px=(640, 480))
LEVELS = [(-20.0, 6.0), (-10.0, 0.0), (0.0, -6.0), (10.0, 0.0), (20.0, 6.0)]
DOTS_MM = np.array([(x, y, z) for y, z in LEVELS for x in np.arange(-30.0, 31.0, 5.0)])
HIDDEN = np.arange(len(DOTS_MM)) % 4 == 2
SEEDS = [0, 12, 13, 25, 39, 45, 52, 64]


def photograph(seed: int) -> tuple[NDArray[np.float32], FloatArray]:
    """Dots of 9 px, a quarter of them hidden, and 300 small specks."""
    rng = np.random.default_rng(seed)
    image = np.full((480, 640), 10, np.float32)
    places_px = CAMERA.project(DOTS_MM)
    for u, v in places_px[~HIDDEN]:
        cv2.circle(image, (round(u * 16), round(v * 16)), 72, 150.0, -1, cv2.LINE_AA, 4)
    for u, v in rng.uniform(0, [640, 480], (300, 2)):
        image[int(v), int(u)] += 120
    return np.asarray(cv2.GaussianBlur(image, (0, 0), 1.0), dtype=np.float32), places_px


@pytest.mark.parametrize("seed", range(3))
def test_visible_dots_are_found_and_hidden_ones_are_not_invented(seed: int) -> None:
    image, places_px = photograph(seed)
    rng = np.random.default_rng(seed)
    seeds = {n: tuple((places_px[n] + rng.uniform(-4, 4, 2)).tolist()) for n in SEEDS if not HIDDEN[n]}
    found = find_known_dots(image, DOTS_MM, seeds, diameter_px=9.0)
    assert not HIDDEN[found.indices].any()
    assert len(found.indices) >= 0.95 * (~HIDDEN).sum()
    assert np.linalg.norm(found.image_px - places_px[found.indices], axis=1).max() < 0.8


def test_few_seeds_are_refused() -> None:
    with pytest.raises(TargetNotFound, match="5 seeds, at least 6"):
        find_known_dots(photograph(0)[0], DOTS_MM, {n: (10.0, 10.0) for n in range(5)}, diameter_px=9.0)


def test_seeds_on_empty_ground_are_refused() -> None:
    with pytest.raises(TargetNotFound, match="dots where 6 or more"):
        find_known_dots(
            np.zeros((100, 100)), DOTS_MM, {n: (10.0 * number, 50.0) for number, n in enumerate(SEEDS)}, diameter_px=9.0
        )
