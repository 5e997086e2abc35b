"""Texts that a file of droplets has beside its columns: JSON, which others may have edited."""

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BaseModel, Field, Json, ValidationError, model_validator

from daq.files.run_directory import Spray
from processing.analysis.droplets.measured_exposure import ShotVerdict
from processing.reconstruction.settings import GridSettings


class _Hidden(BaseModel):
    volume_share: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] = 0.0
    measured_percent: dict[str, list[list[Annotated[int, Field(ge=0, le=100)]]]] | None = None


class _FoundOfClass(BaseModel):
    number: int
    placed: Annotated[int, Field(ge=0)]
    found: Annotated[int, Field(ge=0)]

    @model_validator(mode="after")
    def _no_more_than_there_were(self) -> "_FoundOfClass":
        if self.found > self.placed:
            raise ValueError(f"{self.found} droplets found of {self.placed}")
        return self


class _Twins(BaseModel):
    classes: tuple[_FoundOfClass, ...] = ()


class _Exposure(BaseModel):
    twins: _Twins | None = None
    verdict: ShotVerdict
    reasons: tuple[str, ...] = ()
    hidden: _Hidden = _Hidden()


class _Texts(BaseModel):
    exposures: Json[dict[str, _Exposure]] | None = None
    grid: Json[GridSettings] | None = None
    spray: Json[Spray] | None = None
    settings: Json[dict[str, Any]] | None = None
    notes: Json[dict[str, Any]] | None = None
    velocity: Json[dict[str, Any]] | None = None


def fault_of(provenance: Mapping[str, object]) -> str | None:
    """What cannot be read of what a file says of itself; None where all can."""
    try:
        _Texts.model_validate(provenance)
    except ValidationError as error:
        first = error.errors()[0]
        return f"{'.'.join(map(str, first['loc']))}: {first['msg']}"
    return None
