"""Reading images from elsewhere: any format OpenCV knows by its content, 8 to 16 bit, as grey values."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.errors import BadInput

GreyImage = NDArray[np.uint8] | NDArray[np.uint16]


class ImageFileError(BadInput):
    """An image file cannot be read; the text names the file."""


def read_image(path: Path) -> GreyImage:
    """Grey values (row, column), uint8 or uint16. Colour is converted; the file's name does not matter.

    Raises
    ------
    ImageFileError
        The file is missing, or is not such an image.
    """
    try:
        content = np.fromfile(path, dtype=np.uint8)
    except OSError as error:
        raise ImageFileError(f"{path}: {error.strerror}") from error
    image = cv2.imdecode(content, cv2.IMREAD_UNCHANGED) if content.size else None
    if image is None:
        raise ImageFileError(f"{path}: not an image that OpenCV reads")
    if image.ndim == 3:
        image = cv2.cvtColor(image, cv2.COLOR_BGRA2GRAY if image.shape[2] == 4 else cv2.COLOR_BGR2GRAY)
    if image.dtype == np.uint8:
        return np.asarray(image, dtype=np.uint8)
    if image.dtype == np.uint16:
        return np.asarray(image, dtype=np.uint16)
    raise ImageFileError(f"{path}: grey values of type {image.dtype}, integers of 8 to 16 bit are needed")
