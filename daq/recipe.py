"""Recipe: what is made of every valid shot of a run by itself. This package stores it; what it means, others know."""

from typing import Annotated, Literal

from pydantic import Field, JsonValue

from daq.frozen_model import FrozenModel


class Recipe(FrozenModel):
    """One thing that is made of every valid shot by itself, and how."""

    command: Annotated[
        Literal["reconstruct", "measure"], Field(description="volumes, or droplets, as the command of this name")
    ]
    settings: Annotated[
        dict[str, JsonValue],
        Field(
            description="of the command; what is left out has its default, and is spelled out in the run; a grid may "
            "be stated as with --grid"
        ),
    ] = Field(default_factory=dict)
    sha256: Annotated[
        str,
        Field(max_length=64, description="of command, method and settings; the server fills it in, or refuses another"),
    ] = ""
