"""Images that say themselves what they are: firing, view and exposure in their first pixels, to prove a recording.

One pixel per bit, black or white: 32 bits of firing, 4 of view, 1 of exposure, and 11 that check the others.
"""

import zlib
from dataclasses import dataclass
from typing import Literal

import numpy as np

from processing.synthetic.sensor import Image

_FIRING_BITS, _VIEW_BITS, _CHECK_BITS = 32, 4, 11
_BITS = _FIRING_BITS + _VIEW_BITS + 1 + _CHECK_BITS


@dataclass(frozen=True)
class ImageNumber:
    """Which image it is: number of the firing, number of the view (0 to 15), exposure."""

    firing: int
    view: int
    frame: Literal["A", "B"]


def numbered(image: Image, number: ImageNumber, bits: int) -> Image:
    """The same image (row, column) with its number in the first pixels; ``bits`` of a grey value are significant."""
    if image.size < _BITS:
        raise ValueError(f"an image of {image.shape} pixels has no room for the {_BITS} bits of its number")
    word = (number.firing << _VIEW_BITS | number.view) << 1 | (number.frame == "B")
    word = word << _CHECK_BITS | _check(word)
    marked = image.copy()
    marked.flat[:_BITS] = [(2**bits - 1) * (word >> place & 1) for place in reversed(range(_BITS))]
    return marked


def number_of(image: Image) -> ImageNumber | None:
    """What the first pixels of an image say; None if they do not belong together, as in a damaged image."""
    levels = image.flat[:_BITS]
    white = levels > max(int(np.max(levels)) // 2, 1)
    word = int("".join("1" if one else "0" for one in white), 2)
    told, check = word >> _CHECK_BITS, word & (2**_CHECK_BITS - 1)
    if check != _check(told):
        return None
    return ImageNumber(told >> _VIEW_BITS + 1, told >> 1 & (2**_VIEW_BITS - 1), "B" if told & 1 else "A")


def _check(word: int) -> int:
    return zlib.crc32(word.to_bytes(8)) % (1 << _CHECK_BITS)
