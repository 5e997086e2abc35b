"""Images whose edges a threshold has set, whatever came after it; edges of cameras are not taken for such."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from processing.analysis.flat.darkness import LightError
from processing.analysis.flat.flat_droplets import measure_flat
from tests.support.flat_scenes import shadow

DISCS = [(50.2 + 45 * column, 40.3 + 40 * row, 14.0 + column) for column in range(4) for row in range(2)]


def through_jpeg(image: NDArray[np.uint8], quality: int) -> NDArray[np.uint8]:
    _, coded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE), np.uint8)


def binary() -> NDArray[np.uint8]:
    image = shadow(DISCS, 2.0)
    return np.asarray((image > 0.7 * image.max()) * 170, np.uint8)


@pytest.mark.parametrize("quality", [95, 75])
def test_two_grey_values_through_jpeg_are_refused(quality: int) -> None:
    with pytest.raises(LightError, match="spots of two grey values"):
        measure_flat(through_jpeg(binary(), quality))


def test_two_grey_values_with_noise_are_refused() -> None:
    noise = np.random.default_rng(1).integers(0, 5, binary().shape)
    with pytest.raises(LightError, match="spots of two grey values"):
        measure_flat((binary() + noise).astype(np.uint8))


@pytest.mark.parametrize("blur_px", [0.0, 0.7])
def test_sharp_discs_and_what_hides_an_image_are_measured(blur_px: float) -> None:
    image = np.clip(shadow(DISCS, blur_px), 0, 255).astype(np.uint8)
    assert len(measure_flat(image)) == len(DISCS)
    assert len(measure_flat(through_jpeg(image, 95))) == len(DISCS)
    image[:, :8] = 0
    assert len(measure_flat(image)) == len(DISCS)
