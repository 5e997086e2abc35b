"""How bright an exposure is, for the caption of a live picture. Pure."""

from typing import Annotated

from pydantic import Field

from daq.frozen_model import FrozenModel
from daq.run.shots.shot_check import bright_level
from daq.shot import Image


class ExposureLevel(FrozenModel):
    """Light in one exposure."""

    light_percent: Annotated[
        float, Field(description="grey value that a tenth of the image exceeds, in percent of the largest one")
    ]
    saturated_percent: Annotated[float, Field(description="pixels with the largest grey value")]


def exposure_level(image: Image, bits: int) -> ExposureLevel:
    """Light of an image (row, column) with so many significant bits."""
    full = 2**bits - 1
    return ExposureLevel(
        light_percent=round(100 * bright_level(image) / full, 1),
        saturated_percent=round(100 * float((image >= full).mean()), 3),
    )
