"""Figures of an exposure, for whoever aligns a camera: light, saturation, sharpness, histogram. Pure, of all pixels.

An exposure of 2 megapixels takes about 1 ms of one processor.
"""

from typing import Annotated

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from daq.frozen_model import FrozenModel
from daq.run.shots.shot_check import LIT_FRACTION_OF_SCALE
from daq.shot import Image
from server.pictures.pictures import Stretch, halved, to_grey

HALF_RANGE_PERCENT = 50.0
"""Where the paper sets the light of its background: as far from the noise as from saturation."""
BINS = 64
_BRIGHT = 0.9
_STEEP = 0.999
"""Of all pixels, those on the edges of droplets are few; noise alone reaches a twentieth of a sharp edge here."""
_STEP_PX = 4
"""Distance of the pixels that are compared: two of the image at half its size, which is quieter."""


class ExposureFigures(FrozenModel):
    """What an exposure says of light and lens; full scale is the largest grey value of the sensor's bits."""

    light_percent: Annotated[
        float, Field(description="grey value that a tenth of all pixels exceeds, in percent of full scale")
    ]
    saturated_percent: Annotated[float, Field(description="pixels at full scale")]
    focus_percent: Annotated[
        float | None,
        Field(
            description="steepness of edges: grey value per pixel that one pixel in 1000 exceeds, in percent of the "
            "light; higher is sharper; null: there is no light to see edges in"
        ),
    ]
    histogram: Annotated[
        tuple[int, ...], Field(description=f"pixels in each of {BINS} equal parts of the range from 0 to full scale")
    ]


def exposure_figures(image: Image, bits: int) -> ExposureFigures:
    """Figures of an image (row, column) with so many significant bits."""
    counts, full = _counts(image, bits), 2**bits - 1
    light = _exceeded_by(counts, 1 - _BRIGHT) / full
    return ExposureFigures(
        light_percent=round(100 * light, 1),
        saturated_percent=round(100 * float(counts[-1]) / image.size, 3),
        focus_percent=None if light < LIT_FRACTION_OF_SCALE else round(_steepness(image, bits) / light, 1),
        histogram=tuple(counts.reshape(BINS, -1).sum(axis=1).tolist()),
    )


def _counts(image: Image, bits: int) -> NDArray[np.int64]:
    """Pixels of each grey value; what is above full scale, which is a mistake of somebody, counts as full."""
    values = 2**bits
    counts = cv2.calcHist([image], [0], None, [values], [0, values]).ravel().astype(np.int64)
    counts[-1] += image.size - counts.sum()
    return counts


def _exceeded_by(counts: NDArray[np.int64], share: float) -> int:
    """The value that this share of all pixels exceeds."""
    return int(np.searchsorted(np.cumsum(counts), (1 - share) * counts.sum()))


def _steepness(image: Image, bits: int) -> float:
    """Difference per pixel at the steepest edges, in percent of full scale."""
    small = to_grey(halved(image), bits, Stretch.FULL)
    if min(small.shape) < 3:
        return 0.0
    columns, rows = cv2.absdiff(small[:, 2:], small[:, :-2]), cv2.absdiff(small[2:], small[:-2])
    counts = _counts(np.asarray(columns, np.uint8), 8) + _counts(np.asarray(rows, np.uint8), 8)
    return 100 * _exceeded_by(counts, 1 - _STEEP) / 255 / _STEP_PX
