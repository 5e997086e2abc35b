"""What no device knows of a run: who, with what, and where the nozzle is. Values only."""

from typing import Annotated, Self

from pydantic import AfterValidator, Field, StringConstraints, model_validator

from daq.frozen_model import FrozenModel


def _storable(text: str) -> str:
    if "\0" in text:
        raise ValueError("holds the character NUL, which ends a text in HDF5: leave it out")
    return text


_Text = Annotated[str, AfterValidator(_storable)]
_Line = Annotated[_Text, StringConstraints(max_length=200)]
_Key = Annotated[str, StringConstraints(pattern=r"^[A-Za-z][A-Za-z0-9_]{0,63}$")]
_Millimetres = Annotated[float, Field(ge=-10_000, le=10_000)]
_Share = Annotated[float, Field(ge=-1e6, le=1e6)]


class RunNotes(FrozenModel):
    """Conditions of a run, as the operator writes them down."""

    operator: Annotated[_Line, Field(description="who measured")] = ""
    fluid: Annotated[_Line, Field(description="what is sprayed")] = ""
    nozzle: Annotated[_Line, Field(description="which nozzle, its maker and number")] = ""
    pressure_bar: Annotated[float | None, Field(ge=0, le=10_000, description="of the fluid, above ambient")] = None
    remark: Annotated[_Text, StringConstraints(max_length=4000), Field(description="whatever else matters")] = ""
    more: Annotated[
        dict[_Key, float | _Line],
        Field(max_length=64, description="fields of your own; a unit ends the name of a quantity"),
    ] = Field(default_factory=dict)


class Spray(FrozenModel):
    """Where the spray comes from, and where it goes, in the coordinates of the calibration."""

    nozzle_mm: Annotated[
        tuple[_Millimetres, _Millimetres, _Millimetres], Field(description="x, y, z of the middle of the orifice")
    ]
    axis: Annotated[
        tuple[_Share, _Share, _Share], Field(description="direction in which the spray leaves, of any length; y: down")
    ] = (0.0, 1.0, 0.0)

    @model_validator(mode="after")
    def _leads_somewhere(self) -> Self:
        if not any(self.axis):
            raise ValueError("axis: 0, 0, 0 is no direction")
        return self
