"""What a calibration file says, as validated values; conversion to and from ``Calibration``; its id."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from processing.calibration.calibration import (
    BoardPose,
    Calibration,
    Model,
    ParameterCovariance,
    PlaneError,
    Verdict,
    ViewCalibration,
)
from processing.calibration.fit.polynomial import EXPONENTS, PolynomialMapping
from processing.calibration.target.targets import Target
from processing.geometry import FloatArray, PinholeCamera, ViewMapping

SCHEMA: Literal["tomoshadow.calibration"] = "tomoshadow.calibration"
VERSION: Literal[1] = 1
AXES = (
    "World: right-handed, mm, y down, a view at azimuth 0 looks along +z. Image: u = column, v = row, px, "
    "pixel centres at integers. Rotation and translation: world to camera. Angles in rad."
)

Vector = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
Matrix = tuple[Vector, Vector, Vector]
Pair = tuple[FiniteFloat, FiniteFloat]
NonNegative = Annotated[FiniteFloat, Field(ge=0)]

_LATER = ("parent", "covariance", "candidates_holdout_error_px", "max_error_px", "holdout_error_px")
"""Fields that files may lack, as they came later."""


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class PinholeRecord(_Record):
    """Parameters of a pinhole camera (eq. 3), distortion and tilt as in OpenCV."""

    kind: Literal["pinhole"] = "pinhole"
    image_size_px: tuple[int, int]
    camera_matrix_px: Matrix
    rotation: Matrix
    translation_mm: Vector
    distortion_k1_k2_p1_p2_k3: Annotated[tuple[FiniteFloat, ...], Field(min_length=5, max_length=5)]
    tilt_rad: Pair


class PolynomialRecord(_Record):
    """Coefficients of a polynomial mapping; exponents are those of x, y and z."""

    kind: Literal["polynomial"] = "polynomial"
    image_size_px: tuple[int, int]
    centre_mm: Vector
    scale_mm: Vector
    exponents: tuple[tuple[int, int, int], ...]
    coefficients_px: Annotated[tuple[Pair, ...], Field(min_length=len(EXPONENTS), max_length=len(EXPONENTS))]


class PlaneRecord(_Record):
    """Errors of one plane."""

    name: str
    z_mm: FiniteFloat | None
    n_points: Annotated[int, Field(ge=0)]
    mean_error_px: NonNegative
    rms_px: NonNegative
    max_error_px: NonNegative | None = None
    holdout_error_px: NonNegative | None = None


class BoardRecord(_Record):
    """Pose of a board in camera coordinates."""

    name: str
    rotation: Matrix
    translation_mm: Vector


class CovarianceRecord(_Record):
    """Covariance of fitted parameters: root times its transpose."""

    parameters: tuple[str, ...]
    root: tuple[tuple[FiniteFloat, ...], ...]

    @model_validator(mode="after")
    def _is_square(self) -> "CovarianceRecord":
        if {len(self.parameters)} != {len(self.root), *map(len, self.root)}:
            raise ValueError("root: one row and one column for every parameter")
        return self


class ViewRecord(_Record):
    """One view."""

    verdict: Verdict
    model: Model
    n_points: Annotated[int, Field(ge=0)]
    n_rejected: Annotated[int, Field(ge=0)]
    mean_error_px: NonNegative
    rms_px: NonNegative
    max_error_px: NonNegative
    holdout_error_px: NonNegative
    mapping: Annotated[PinholeRecord | PolynomialRecord, Field(discriminator="kind")]
    extent_mm: tuple[Pair, ...]
    boards_in_free_poses: tuple[BoardRecord, ...]
    planes: tuple[PlaneRecord, ...]
    covariance: CovarianceRecord | None = None
    candidates_holdout_error_px: dict[Model, NonNegative] | None = None


class CalibrationRecord(_Record):
    """A whole calibration file."""

    schema_name: Annotated[Literal["tomoshadow.calibration"], Field(alias="schema")] = SCHEMA
    version: Literal[1] = VERSION
    id: str
    parent: str | None = None
    created_utc: str
    source: str
    software: dict[str, str]
    axes: str = AXES
    target: Target | None
    z_range_mm: Pair
    notes: tuple[str, ...]
    views: Annotated[dict[str, ViewRecord], Field(min_length=1, max_length=8)]


def to_record(calibration: Calibration, software: dict[str, str]) -> CalibrationRecord:
    """Calibration as the file says it."""
    return CalibrationRecord(
        id=calibration.id,
        parent=calibration.parent,
        created_utc=calibration.created_utc,
        source=calibration.source,
        software=software,
        target=calibration.target,
        z_range_mm=calibration.z_range_mm,
        notes=calibration.notes,
        views={name: _view_record(view) for name, view in calibration.views.items()},
    )


def from_record(record: CalibrationRecord) -> Calibration:
    """Calibration that the file describes; floats are exact."""
    return Calibration(
        id=record.id,
        parent=record.parent,
        created_utc=record.created_utc,
        target=record.target,
        views={name: _view(view) for name, view in record.views.items()},
        z_range_mm=record.z_range_mm,
        source=record.source,
        notes=record.notes,
    )


def content_id(calibration: Calibration) -> str:
    """Id from the content: everything but id, date and software versions."""
    return json_id(to_json(to_record(calibration, {})))


def json_id(content: Mapping[str, Any]) -> str:
    """Id of a file's content as it stands there: fields that came later do not change the ids of older files."""
    lasting = {key: value for key, value in content.items() if key not in ("id", "created_utc", "software")}
    digest = hashlib.sha256(json.dumps(lasting, sort_keys=True).encode()).hexdigest()
    return f"cal-{digest[:12]}"


def to_json(record: CalibrationRecord) -> dict[str, Any]:
    """Record as JSON values; optional fields that are not known are left out, as in files older than they."""
    content = record.model_dump(mode="json", by_alias=True)
    views = content["views"].values()
    for described in (content, *views, *(plane for view in views for plane in view["planes"])):
        for optional in _LATER:
            if optional in described and described[optional] is None:
                del described[optional]
    return content


def _view_record(view: ViewCalibration) -> ViewRecord:
    return ViewRecord(
        verdict=view.verdict,
        model=view.model,
        n_points=view.n_points,
        n_rejected=view.n_rejected,
        mean_error_px=view.mean_error_px,
        rms_px=view.rms_px,
        max_error_px=view.max_error_px,
        holdout_error_px=view.holdout_error_px,
        mapping=_mapping_record(view.mapping),
        extent_mm=view.extent_mm,
        boards_in_free_poses=tuple(
            BoardRecord(name=pose.name, rotation=_matrix(pose.rotation), translation_mm=_vector(pose.translation_mm))
            for pose in view.board_poses
        ),
        planes=tuple(PlaneRecord(**asdict(plane)) for plane in view.planes),
        covariance=_covariance_record(view.covariance),
        candidates_holdout_error_px=dict(view.candidates_px) or None,
    )


def _view(record: ViewRecord) -> ViewCalibration:
    return ViewCalibration(
        mapping=_mapping(record.mapping),
        model=record.model,
        n_points=record.n_points,
        mean_error_px=record.mean_error_px,
        rms_px=record.rms_px,
        max_error_px=record.max_error_px,
        holdout_error_px=record.holdout_error_px,
        planes=tuple(PlaneError(**plane.model_dump()) for plane in record.planes),
        verdict=record.verdict,
        n_rejected=record.n_rejected,
        extent_mm=record.extent_mm,
        board_poses=tuple(
            BoardPose(board.name, np.array(board.rotation), np.array(board.translation_mm))
            for board in record.boards_in_free_poses
        ),
        covariance=_covariance(record.covariance),
        candidates_px=record.candidates_holdout_error_px or {},
    )


def _covariance_record(covariance: ParameterCovariance | None) -> CovarianceRecord | None:
    if covariance is None:
        return None
    return CovarianceRecord(parameters=covariance.names, root=tuple(tuple(row) for row in covariance.root.tolist()))


def _covariance(record: CovarianceRecord | None) -> ParameterCovariance | None:
    return None if record is None else ParameterCovariance(record.parameters, np.array(record.root))


def _mapping_record(mapping: ViewMapping) -> PinholeRecord | PolynomialRecord:
    match mapping:
        case PinholeCamera():
            return PinholeRecord(
                image_size_px=mapping.image_size_px,
                camera_matrix_px=_matrix(mapping.camera_matrix),
                rotation=_matrix(mapping.rotation),
                translation_mm=_vector(mapping.translation_mm),
                distortion_k1_k2_p1_p2_k3=tuple(float(value) for value in mapping.distortion),
                tilt_rad=mapping.tilt_rad,
            )
        case PolynomialMapping():
            return PolynomialRecord(
                image_size_px=mapping.image_size_px,
                centre_mm=_vector(mapping.centre_mm),
                scale_mm=_vector(mapping.scale_mm),
                exponents=EXPONENTS,
                coefficients_px=tuple((float(u), float(v)) for u, v in mapping.coefficients),
            )
        case _:
            raise TypeError(f"no record for a mapping of type {type(mapping).__name__}")


def _mapping(record: PinholeRecord | PolynomialRecord) -> ViewMapping:
    if isinstance(record, PolynomialRecord):
        return PolynomialMapping(
            np.array(record.coefficients_px),
            np.array(record.centre_mm),
            np.array(record.scale_mm),
            record.image_size_px,
        )
    return PinholeCamera(
        camera_matrix=np.array(record.camera_matrix_px),
        rotation=np.array(record.rotation),
        translation_mm=np.array(record.translation_mm),
        image_size_px=record.image_size_px,
        distortion=np.array(record.distortion_k1_k2_p1_p2_k3),
        tilt_rad=record.tilt_rad,
    )


def _vector(values: FloatArray) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _matrix(values: FloatArray) -> Matrix:
    first, second, third = (_vector(row) for row in values)
    return first, second, third
