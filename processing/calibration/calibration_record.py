"""A calibration file as one validated value: its header, the views as they are, and the id of its content."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import fields
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from processing.calibration.calibration import Calibration, ViewCalibration
from processing.calibration.stored_fields import Pair
from processing.calibration.target.targets import Target
from processing.calibration.verdict import Unchecked
from processing.kernels import _native

SCHEMA: Literal["tomoshadow.calibration"] = "tomoshadow.calibration"
VERSION: Literal[1] = 1
AXES = (
    "World: right-handed, mm, y down, a view at azimuth 0 looks along +z. Image: u = column, v = row, px, "
    "pixel centres at integers. Rotation and translation: world to camera. Angles in rad."
)

_LATER = (
    *("parent", "covariance", "candidates_holdout_error_px", "max_error_px", "holdout_error_px"),
    *("reasons", "rays_miss_px", "not_checked"),
)
"""Fields that files may lack, as they came later."""


class CalibrationRecord(BaseModel):
    """A whole calibration file."""

    model_config = ConfigDict(frozen=True, extra="forbid")

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
    not_checked: tuple[Unchecked, ...] = ()
    views: Annotated[dict[str, ViewCalibration], Field(min_length=1, max_length=_native.MAX_VIEWS)]


def to_record(calibration: Calibration, software: dict[str, str]) -> CalibrationRecord:
    """Calibration as the file says it."""
    return CalibrationRecord(software=software, **vars(calibration))


def from_record(record: CalibrationRecord) -> Calibration:
    """Calibration that the file describes; floats are exact."""
    return Calibration(**{field.name: getattr(record, field.name) for field in fields(Calibration)})


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
            if optional in described and described[optional] in (None, {}, []):
                del described[optional]
    CalibrationRecord.model_validate(content)  # nothing is written that could not be read again
    return content
