"""An image tells which one it is, and a damaged one tells nothing."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from processing.synthetic.numbered import ImageNumber, number_of, numbered


@pytest.mark.parametrize(("bits", "dtype"), [(8, np.uint8), (12, np.uint16)])
@pytest.mark.parametrize("frame", ["A", "B"])
def test_an_image_keeps_its_number(bits: int, dtype: type, frame: Any) -> None:
    image: NDArray[Any] = np.random.default_rng(1).integers(0, 2**bits, (24, 32)).astype(dtype)
    for firing in (0, 1, 65_536, 2**32 - 1):
        number = ImageNumber(firing, 3, frame)
        marked = numbered(image, number, bits)
        assert number_of(marked) == number
        np.testing.assert_array_equal(marked[2:], image[2:])


def test_a_damaged_or_unmarked_image_has_no_number() -> None:
    marked = numbered(np.zeros((24, 32), np.uint8), ImageNumber(7, 1, "B"), 8)
    for place in range(48):
        damaged = marked.copy()
        damaged.flat[place] ^= 255
        assert number_of(damaged) is None
    assert number_of(np.full((24, 32), 90, np.uint8)) is None
    assert number_of(np.zeros((24, 32), np.uint8)) is None


def test_an_image_without_room_is_refused() -> None:
    with pytest.raises(ValueError, match="no room for the 48 bits"):
        numbered(np.zeros((2, 3), np.uint8), ImageNumber(7, 1, "B"), 8)
