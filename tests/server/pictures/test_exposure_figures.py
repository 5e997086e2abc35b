from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from daq.shot import Image
from server.pictures.exposure_figures import BINS, exposure_figures


def grey(bits: int, value: int) -> Image:
    shape = (80, 100)
    return np.full(shape, value, np.uint8) if bits == 8 else np.full(shape, value, np.uint16)


def typed(values: NDArray[Any], bits: int) -> Image:
    return values.astype(np.uint8) if bits == 8 else values.astype(np.uint16)


def droplets(number: int = 30, blur_px: float = 0.0, light: float = 0.5, noise: float = 0.0, bits: int = 8) -> Image:
    """A shadowgraph of 200 x 300 px."""
    rng, full = np.random.default_rng(number), 2**bits - 1
    image = np.ones((200, 300), np.float32)
    for _ in range(number):
        x_px, y_px = rng.integers(10, 290), rng.integers(10, 190)
        cv2.circle(image, (int(x_px), int(y_px)), 5, 0.0, -1)
    if blur_px:
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), blur_px))
    image = image * light * full + rng.normal(0, noise * full, image.shape)
    return typed(image.clip(0, full), bits)


def focus(image: Image, bits: int = 8) -> float:
    percent = exposure_figures(image, bits).focus_percent
    assert percent is not None
    return percent


@pytest.mark.parametrize("bits", [8, 10, 12, 16])
def test_light_and_saturation_are_shares_of_the_range_of_the_sensor(bits: int) -> None:
    full = 2**bits - 1
    image = grey(bits, full // 2)
    assert exposure_figures(image, bits).light_percent == pytest.approx(50, abs=0.5)
    assert exposure_figures(image, bits).saturated_percent == 0
    image[:2] = full
    assert exposure_figures(image, bits).saturated_percent == 2.5
    image[:20] = full  # more than a tenth
    assert exposure_figures(image, bits).light_percent == 100


def test_values_above_the_bits_of_the_sensor_count_as_saturated() -> None:
    image = grey(12, 100)
    image[:4] = 60_000
    figures = exposure_figures(image, 12)
    assert figures.saturated_percent == 5
    assert sum(figures.histogram) == image.size


@pytest.mark.parametrize("bits", [8, 12])
def test_the_histogram_counts_every_pixel_once_where_it_belongs(bits: int) -> None:
    values = np.random.default_rng(1).integers(0, 2**bits, (97, 131))
    expected = np.bincount(values.ravel() >> (bits - 6), minlength=BINS)
    assert exposure_figures(typed(values, bits), bits).histogram == tuple(expected.tolist())


def test_every_pixel_counts_also_one_that_a_stride_would_leave_out() -> None:
    image = grey(8, 100)
    image[3, 5] = 255
    assert exposure_figures(image, 8).saturated_percent == pytest.approx(100 / image.size, abs=5e-4)


@pytest.mark.parametrize("bits", [8, 12])
def test_the_focus_falls_with_every_blur(bits: int) -> None:
    values = [focus(droplets(blur_px=blur_px, bits=bits), bits) for blur_px in (0, 1, 2, 4)]
    assert values == sorted(values, reverse=True)
    assert values[0] > 2 * values[-1]


def test_the_focus_tells_the_lens_and_neither_the_light_nor_the_number_of_droplets() -> None:
    reference = focus(droplets())
    assert focus(droplets(light=0.9)) == pytest.approx(reference, rel=0.05)
    assert focus(droplets(light=0.25)) == pytest.approx(reference, rel=0.1)
    assert focus(droplets(number=60)) == pytest.approx(reference, rel=0.15)
    assert focus(droplets(number=15)) == pytest.approx(reference, rel=0.15)


def test_noise_of_a_sensor_is_no_sharpness() -> None:
    assert focus(droplets(number=0, noise=0.01)) < 0.2 * focus(droplets())
    assert focus(droplets(blur_px=3, noise=0.01)) < 0.5 * focus(droplets())


@pytest.mark.parametrize("value", [0, 4, 12])
def test_the_dark_has_no_focus(value: int) -> None:
    assert exposure_figures(grey(8, value), 8).focus_percent is None


@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (5, 4)])
def test_a_tiny_image_has_figures_too(shape: tuple[int, int]) -> None:
    assert exposure_figures(np.full(shape, 128, np.uint8), 8).focus_percent == 0
