"""Arrays and camera models as a calibration file holds them: annotations by which pydantic reads and writes a field."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from processing.calibration.polynomial_mapping import EXPONENTS, PolynomialMapping
from processing.geometry import FloatArray, PinholeCamera, ViewMapping

Pair = tuple[FiniteFloat, FiniteFloat]
_Triple = tuple[FiniteFloat, FiniteFloat, FiniteFloat]


@dataclass(frozen=True)
class _Stored:
    """A field that a file holds in another form.

    Parameters
    ----------
    form : type
        What stands in the file.
    read, write : callable
        From there to the value of the field, and back.
    """

    form: Any
    read: Callable[[Any], Any] = np.array
    write: Callable[[Any], Any] = np.ndarray.tolist

    def __get_pydantic_core_schema__(self, _value: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_after_validator_function(
            self.read,
            handler.generate_schema(self.form),
            serialization=core_schema.plain_serializer_function_ser_schema(self.write),
        )


def _square(rows: tuple[tuple[float, ...], ...]) -> FloatArray:
    if any(len(row) != len(rows) for row in rows):
        raise ValueError("one row and one column for every parameter")
    return np.array(rows)


Vector = Annotated[FloatArray, _Stored(_Triple)]
Matrix = Annotated[FloatArray, _Stored(tuple[_Triple, _Triple, _Triple])]
Square = Annotated[FloatArray, _Stored(tuple[tuple[FiniteFloat, ...], ...], _square)]
_Distortion = Annotated[FloatArray, _Stored(Annotated[tuple[FiniteFloat, ...], Field(min_length=5, max_length=5)])]
_Coefficients = Annotated[
    FloatArray, _Stored(Annotated[tuple[Pair, ...], Field(min_length=len(EXPONENTS), max_length=len(EXPONENTS))])
]


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class _PinholeRecord(_Record):
    """A pinhole camera (eq. 3); distortion and tilt as in OpenCV."""

    kind: Literal["pinhole"] = "pinhole"
    image_size_px: tuple[int, int]
    camera_matrix: Annotated[Matrix, Field(alias="camera_matrix_px")]
    rotation: Matrix
    translation_mm: Vector
    distortion: Annotated[_Distortion, Field(alias="distortion_k1_k2_p1_p2_k3")]
    tilt_rad: Pair


class _PolynomialRecord(_Record):
    """A polynomial mapping; exponents are those of x, y and z."""

    kind: Literal["polynomial"] = "polynomial"
    image_size_px: tuple[int, int]
    centre_mm: Vector
    scale_mm: Vector
    exponents: tuple[tuple[int, int, int], ...] = EXPONENTS
    coefficients: Annotated[_Coefficients, Field(alias="coefficients_px")]


_RECORDS: Mapping[type, type[_Record]] = {PinholeCamera: _PinholeRecord, PolynomialMapping: _PolynomialRecord}


def _record_of(mapping: ViewMapping) -> _Record:
    return _RECORDS[type(mapping)].model_construct(**vars(mapping))


def _mapping_of(record: _Record) -> ViewMapping:
    model = PinholeCamera if isinstance(record, _PinholeRecord) else PolynomialMapping
    return model(**{field.name: getattr(record, field.name) for field in fields(model)})


StoredMapping = Annotated[
    ViewMapping,
    _Stored(Annotated[_PinholeRecord | _PolynomialRecord, Field(discriminator="kind")], _mapping_of, _record_of),
]
