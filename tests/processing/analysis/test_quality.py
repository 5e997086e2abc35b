"""The quality factor, on cases whose answer is known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from processing.analysis.quality import local_maxima, quality_factor


def noise(shape: tuple[int, int, int] = (24, 32, 40), seed: int = 1) -> NDArray[np.float32]:
    return np.random.default_rng(seed).random(shape).astype(np.float32)


def textbook(truth: NDArray[np.float32], volume: NDArray[np.float32], window: int, step: int, mean: bool) -> float:
    coefficients = []
    for corner in np.ndindex(*((n - window) // step + 1 for n in truth.shape)):
        region = tuple(slice(step * c, step * c + window) for c in corner)
        a, b = truth[region].astype(float), volume[region].astype(float)
        a, b = (a - a.mean(), b - b.mean()) if mean else (a, b)
        coefficients.append((a * b).sum() / np.sqrt((a * a).sum() * (b * b).sum()))
    return float(np.mean(coefficients))


@pytest.mark.parametrize("mean", [True, False])
@pytest.mark.parametrize(("window", "step"), [(16, 8), (16, 16), (8, 8), (12, 4)])
def test_it_is_the_mean_of_the_windows_coefficients(window: int, step: int, mean: bool) -> None:
    truth = noise()
    volume = truth**3 + 0.3 * noise(seed=2)
    expected = textbook(truth, volume, window, step, mean)
    assert quality_factor(truth, volume, window, step, mean) == pytest.approx(expected, abs=1e-5)


@given(scale=st.floats(0.01, 100), offset=st.floats(-5, 5))
def test_scale_and_offset_do_not_matter(scale: float, offset: float) -> None:
    truth = noise()
    changed = (scale * (truth + offset)).astype(np.float64)
    assert quality_factor(truth.astype(np.float64), changed, 16, 8) == pytest.approx(1, abs=1e-6)


def test_unrelated_volumes_do_not_correlate() -> None:
    assert abs(quality_factor(noise(), noise(seed=2), 16, 8)) < 0.02


def test_the_paper_has_14_14_6_windows() -> None:
    truth = np.zeros((250, 500, 500), np.float32)
    truth[::5, ::5, ::5] = 1
    volume = truth.copy()
    volume[224:, 480:, 480:] = 9  # what no window covers
    assert quality_factor(truth, volume) == pytest.approx(1, abs=1e-6)


def test_empty_windows_have_no_say() -> None:
    truth = noise()
    truth[:, :, 20:] = 0
    assert quality_factor(truth, truth * 2, 8, 8) == pytest.approx(1, abs=1e-6)


def test_nonsense_is_refused() -> None:
    with pytest.raises(ValueError, match="truth has shape"):
        quality_factor(noise(), noise((24, 32, 41)))
    with pytest.raises(ValueError, match="windows of 64 voxels at steps of 32 do not fit"):
        quality_factor(noise(), noise())
    with pytest.raises(ValueError, match="windows of 16 voxels at steps of 5"):
        quality_factor(noise(), noise(), 16, 5)
    with pytest.raises(ValueError, match="vary together in no window"):
        quality_factor(np.ones((8, 8, 8), np.float32), noise((8, 8, 8)), 8, 8)


def test_a_hill_has_one_maximum() -> None:
    z, y, x = np.mgrid[:9, :9, :9]
    hill = np.exp(-((z - 4.2) ** 2 + (y - 3.9) ** 2 + (x - 5.1) ** 2) / 4)
    np.testing.assert_array_equal(local_maxima(hill, 0.1), [[4, 4, 5]])
