import numpy as np
import pytest

from daq.shot import Image
from server.pictures.exposure_level import exposure_level


def grey(bits: int, value: int) -> Image:
    shape = (80, 100)
    return np.full(shape, value, np.uint8) if bits == 8 else np.full(shape, value, np.uint16)


@pytest.mark.parametrize("bits", [8, 12])
def test_light_and_saturation_are_shares_of_full_scale(bits: int) -> None:
    full = 2**bits - 1
    image = grey(bits, full // 2)
    assert exposure_level(image, bits).light_percent == pytest.approx(50, abs=0.5)
    assert exposure_level(image, bits).saturated_percent == 0
    image[:2] = full
    assert exposure_level(image, bits).saturated_percent == 2.5
    image[:20] = full  # more than a tenth
    assert exposure_level(image, bits).light_percent == 100
