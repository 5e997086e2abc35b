"""Preprocessing: what is left of an exposure is the droplet, whatever the light, the dust and the dark level."""

import numpy as np
import pytest
from numpy.typing import NDArray

from processing.preprocessing import Preprocessing, intensity, opacity, sliding_minimum

ROWS, COLUMNS = 120, 160
BITS = 12


def scene(transmittance: NDArray[np.float64], level: float = 2000.0) -> NDArray[np.uint16]:
    """Exposure of a transmittance with uneven light, dust and a dark level of 60."""
    row, column = np.mgrid[:ROWS, :COLUMNS]
    field = level * (1 - 0.4 * ((row - 60) ** 2 + (column - 80) ** 2) / 10_000)
    field[30:34, 100:104] *= 0.3
    exposure: NDArray[np.uint16] = np.round(60 + field * transmittance).astype(np.uint16)
    return exposure


def references() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    dark = np.full((ROWS, COLUMNS), 60, np.float32)
    return dark, scene(np.ones((ROWS, COLUMNS))).astype(np.float32)


def droplet() -> NDArray[np.float64]:
    transmittance = np.ones((ROWS, COLUMNS))
    transmittance[50:55, 70:75] = 0.2
    return transmittance


def test_background_division_leaves_only_the_droplet() -> None:
    dark, background = references()
    settings = Preprocessing(minimum_window_px=0, noise_floor=0)
    result = intensity(scene(droplet()), settings, bits=BITS, dark=dark, background=background)
    np.testing.assert_allclose(result, 1 - droplet(), atol=2e-3)


@pytest.mark.parametrize("level", [500.0, 2000.0, 3900.0])
def test_result_does_not_depend_on_the_brightness(level: float) -> None:
    dark = np.full((ROWS, COLUMNS), 60, np.float32)
    background = scene(np.ones((ROWS, COLUMNS)), level).astype(np.float32)
    result = intensity(scene(droplet(), level), Preprocessing(), bits=BITS, dark=dark, background=background)
    assert result[52, 72] == pytest.approx((0.8 - 0.05) / 0.95, abs=0.01)
    assert result[10, 10] == 0


def test_sliding_minimum_removes_a_veil_but_keeps_the_droplet() -> None:
    dark, background = references()
    settings = Preprocessing(minimum_window_px=41, noise_floor=0)
    result = intensity(scene(0.7 * droplet()), settings, bits=BITS, dark=dark, background=background)
    assert result[52, 72] == pytest.approx(0.56, abs=0.01)
    assert result[100, 20] == pytest.approx(0.0, abs=0.01)


def test_without_background_the_light_field_is_estimated() -> None:
    result = intensity(scene(droplet()), Preprocessing(minimum_window_px=41), bits=BITS)
    assert result[52, 72] > 0.6
    assert np.median(result) < 0.02


def test_bright_particles_stay_bright() -> None:
    frame = np.full((ROWS, COLUMNS), 10, np.uint8)
    frame[40, 50] = 255
    result = intensity(frame, Preprocessing("bright", minimum_window_px=21, noise_floor=0), bits=8)
    assert result[40, 50] == pytest.approx(245 / 255, abs=1e-3)
    assert result[80, 80] == 0


def test_sliding_minimum_is_the_minimum_of_a_constant_window() -> None:
    image = np.full((50, 60), 0.3, np.float32)
    image[20:23, 30:33] = 0.9
    np.testing.assert_allclose(sliding_minimum(image, 11), 0.3, atol=1e-6)


def test_dark_background_carries_no_information() -> None:
    assert opacity(np.zeros((2, 2), np.float32), np.zeros((2, 2), np.float32)).max() == 0


def test_references_of_another_size_are_refused() -> None:
    with pytest.raises(ValueError, match=r"background image \(3, 3\) does not fit the frame \(120, 160\)"):
        intensity(scene(droplet()), Preprocessing(), bits=BITS, background=np.ones((3, 3), np.float32))
