"""The level of images that are drawn by hand: a formula, noise, and spots."""

import numpy as np
import pytest

from processing.analysis.smooth_level import smooth_level

ROWS, COLUMNS = np.mgrid[:150, :230].astype(np.float64)
FORMULAS = {
    "even": np.full(ROWS.shape, 3.0),
    "ramp": 0.2 * COLUMNS - 0.1 * ROWS,
    "hill": 30 * np.exp(-((COLUMNS - 115) ** 2 + (ROWS - 75) ** 2) / (2 * 50**2)),
}


@pytest.mark.parametrize("level", FORMULAS.values(), ids=FORMULAS.keys())
@pytest.mark.parametrize("spots", [0, 100])
def test_what_varies_slowly_is_told_below_noise_and_spots(level: np.ndarray, spots: int) -> None:
    rng = np.random.default_rng(3)
    image = level + rng.normal(0, 1, level.shape)
    image[rng.integers(0, 150, spots), rng.integers(0, 230, spots)] += 100
    told = smooth_level(image.astype(np.float32), 25)
    assert told.dtype == np.float32
    middle = np.s_[25:-25, 25:-25]
    np.testing.assert_allclose(told[middle], level[middle], atol=0.5)


def test_a_share_of_the_pixels_lies_below_its_surface() -> None:
    image = np.random.default_rng(0).normal(0, 1, (150, 230)).astype(np.float32)
    assert np.mean(image < smooth_level(image, 25, 0.01)) == pytest.approx(0.01, abs=0.003)


@pytest.mark.parametrize("shape", [(64, 64), (20, 30), (26, 49), (51, 100)])
def test_images_of_few_cells_have_a_level(shape: tuple[int, int]) -> None:
    np.testing.assert_allclose(smooth_level(np.full(shape, 2, np.float32), 25), 2, rtol=1e-5)


def test_the_image_stays_as_it_is() -> None:
    image = np.arange(60 * 70, dtype=np.float32).reshape(60, 70)
    smooth_level(image, 25)
    np.testing.assert_array_equal(image, np.arange(60 * 70, dtype=np.float32).reshape(60, 70))
