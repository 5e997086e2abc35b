"""Exposures of a reticle that moved are told from still ones, whatever the noise and what is unknown."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, shift

from processing.analysis.droplets.gaussian_blobs import Image
from processing.analysis.reticle.size_groups import ReticleError
from processing.analysis.reticle.stillness import require_still, shift_px


def exposure(moved_px: tuple[float, float], seed: int) -> Image:
    """Dots of 12 px behind a blur of 0.8 px, in light that has changed by 2 %, and rows that are not known."""
    rows, columns = np.ogrid[:90, :120]
    dots = (np.hypot((rows % 30) - 15, (columns % 30) - 15) < 6).astype(float)
    light = shift(1 - gaussian_filter(dots, 0.8), moved_px, order=1, mode="nearest")
    light += np.random.default_rng(seed).normal(0, 0.015, light.shape)
    light[:6] = 0
    return np.asarray((1 + 0.02 * seed) * light, dtype=np.float32)


KNOWN = np.broadcast_to(np.arange(90)[:, None] >= 6, (90, 120))


@pytest.mark.parametrize("moved_px", [(0, 0), (0.3, 0), (0.1, -0.3)])
def test_noise_is_no_motion(moved_px: tuple[float, float]) -> None:
    first, image = exposure((0, 0), 0), exposure(moved_px, 1)
    np.testing.assert_allclose(shift_px(first, image, KNOWN), moved_px, atol=0.1)
    require_still(first, image, KNOWN, "shot 1, view1")


@pytest.mark.parametrize("moved_px", [(0.7, 0), (0, -1), (2, 1), (0, 5)])
def test_a_motion_is_refused(moved_px: tuple[float, float]) -> None:
    with pytest.raises(ReticleError, match=r"^shot 1, view1: its image lies about .* the reticle moved"):
        require_still(exposure((0, 0), 0), exposure(moved_px, 1), KNOWN, "shot 1, view1")
