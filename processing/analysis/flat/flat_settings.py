"""How droplets of single images are measured."""

from typing import Annotated

from pydantic import Field, FiniteFloat

from processing.preprocessing import Polarity
from processing.reconstruction.settings import FrozenValue


class FlatSettings(FrozenValue):
    """How droplets of single images are measured; travels with every result."""

    polarity: Annotated[Polarity, Field(description="dark droplets before light, or bright particles on black")] = (
        "shadow"
    )
    least_depth: Annotated[
        float, Field(gt=0, lt=1, description="darkness, relative to the light, that a droplet stands out by")
    ] = 0.2
    least_diameter_px: Annotated[FiniteFloat, Field(ge=2, description="smaller ones are dust, or cannot be sized")] = (
        4.0
    )
    least_circularity: Annotated[
        float, Field(gt=0, lt=1, description="4 pi area / perimeter^2; below, it is a ligament, or several droplets")
    ] = 0.8
    most_blur: Annotated[
        float, Field(gt=0, le=0.8, description="blur over radius; above, it is too far out of focus to be sized")
    ] = 0.6
