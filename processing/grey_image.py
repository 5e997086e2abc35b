"""Is an array an image? What is none is refused by name, not taken for what numpy makes of it."""

import warnings
from collections.abc import Mapping

import numpy as np

from processing.masked import require_unmasked
from processing.preprocessing import Intensity

BRIGHTEST = 1.25
"""An intensity beyond this is none: noise reaches a little above 1."""
STEP_PX = 4
"""Every so many rows and columns are asked how much is blocked."""
BLOCKED = 0.5
"""Half of the pixels are above: hardly a spray blocks that much of a view."""


def require_image(name: str, image: object) -> None:
    """Refuse what is no image (rows, columns) of finite grey values.

    Raises
    ------
    ValueError
        The text names it, and what is wrong.
    """
    require_unmasked(name, image)
    pixels = np.asarray(image)
    if pixels.ndim != 2 or not pixels.size:
        raise ValueError(f"{name}: an image is (rows, columns), not {pixels.shape}: colours must be made grey first")
    if not np.issubdtype(pixels.dtype, np.integer) and not np.issubdtype(pixels.dtype, np.floating):
        raise ValueError(f"{name}: is of {pixels.dtype}, which has no grey values: of a mask nothing can be measured")
    if not np.isfinite(pixels).all():
        row, column = np.argwhere(~np.isfinite(pixels))[0]
        raise ValueError(f"{name}: pixel (column {column}, row {row}) is {pixels[row, column]}")


def require_intensities(images: Mapping[str, Intensity]) -> None:
    """Refuse images of grey values, or masked ones, by view; warn of those that can be no intensities.

    Raises
    ------
    ValueError
        The text names the view.
    """
    for name, image in images.items():
        require_unmasked(name, image)
        if not np.issubdtype(np.asarray(image).dtype, np.floating):
            raise ValueError(f"{name}: its image is of {np.asarray(image).dtype}; make grey values intensities first")
        if odd := _odd_intensity(image):
            warnings.warn(f"{name}: its image {odd}", stacklevel=5)


def _odd_intensity(image: Intensity) -> str:
    """Why an image can be none of intensities, 0 where the view is free and 1 where it is blocked; empty if it can."""
    if image.size and (most := float(image.max())) > BRIGHTEST:
        return f"reaches {most:.4g}, intensities 1: voxels are as much too bright; are these grey values, or per cent?"
    if image.ndim == 2 and image.size and np.median(image[::STEP_PX, ::STEP_PX]) > BLOCKED:
        return f"is above {BLOCKED:g} in half of its pixels: is it the light that is left, and not what is missing?"
    return ""
