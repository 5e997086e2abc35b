"""Grey values of images in colour, where all that they show is grey.

The weights of an eye would take a tenth of a blue light, and turn the brightness of a map of colours around: what a
sensor saw is in one of the colours, and only its user knows in which.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from processing.errors import BadInput

MOST_COLOUR = 1 / 64
"""Of the full scale: so much grey becomes coloured by lossy files."""


class ImageFileError(BadInput):
    """An image file cannot be read; the text names the file."""


def grey_of_colours(path: Path, image: NDArray[Any]) -> NDArray[Any]:
    """Grey values of an image (row, column, blue green red and perhaps alpha).

    Raises
    ------
    ImageFileError
        It has colours that are not grey, is transparent somewhere, or has two values a pixel.
    """
    if image.shape[2] < 3:
        raise ImageFileError(f"{path}: {image.shape[2]} values a pixel, grey or colour is needed")
    if np.issubdtype(image.dtype, np.integer):
        _require_opaque(path, image)
        _require_grey(path, image)
    return np.ascontiguousarray(image[..., 1])


def _require_opaque(path: Path, image: NDArray[Any]) -> None:
    if image.shape[2] == 4 and (clear := image[..., 3] != np.iinfo(image.dtype).max).any():
        row, column = np.argwhere(clear)[0]
        raise ImageFileError(
            f"{path}: is transparent at column {column}, row {row}: nobody knows before what; save it as a grey image"
        )


def _require_grey(path: Path, image: NDArray[Any]) -> None:
    colours = image[..., :3]
    apart = colours.max(axis=2) - colours.min(axis=2)
    if (coloured := apart > MOST_COLOUR * np.iinfo(image.dtype).max).any():
        row, column = np.argwhere(coloured)[0]
        blue, green, red = colours[row, column].tolist()
        raise ImageFileError(
            f"{path}: is coloured at column {column}, row {row}: red {red}, green {green}, blue {blue}; save the "
            "colour of the light, which the sensor saw, as a grey image"
        )
