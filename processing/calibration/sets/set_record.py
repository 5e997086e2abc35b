"""What an import manifest and ``set.json`` say of a calibration: target, planes, measured points."""

from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from processing.calibration.target.targets import Target

SCHEMA: Literal["tomoshadow.calibration_set"] = "tomoshadow.calibration_set"

CameraName = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")]
Pixel = tuple[float, float]
Positive = Annotated[float, Field(gt=0)]
Column = Literal["id", "u_px", "v_px", "x_mm", "y_mm", "z_mm", "skip"]


class _Entry(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class PlaneEntry(_Entry):
    """Images of one target position; without ``z_mm`` a board in a free pose."""

    z_mm: Annotated[float | None, Field(description="of the target; left out where a board was held freely")] = None
    images: Annotated[dict[CameraName, str], Field(min_length=1, description="image file by camera")]
    page: Annotated[int | None, Field(ge=0, description="which image of stacks, counted from 0")] = None
    origin_px: Annotated[dict[CameraName, Pixel], Field(description="overrides the origin_px of the set")] = {}

    @model_validator(mode="after")
    def _has_images_of_origins(self) -> Self:
        if strangers := sorted(set(self.origin_px).difference(self.images)):
            raise ValueError(f"origin_px: there is no image of {', '.join(strangers)}")
        return self


class PointsEntry(_Entry):
    """Points of one camera that were measured elsewhere, or dots of a solid target to be found in an image."""

    camera: Annotated[CameraName, Field(description="whose points they are")]
    file: Annotated[str, Field(description="text file of numbers, a point per line")]
    columns: Annotated[tuple[Column, ...], Field(description="what the columns of the file are")]
    image_size_px: Annotated[tuple[int, int] | None, Field(description="width, height; default: as in the run")] = None
    image: Annotated[str | None, Field(description="find the dots here; the file then has id, x, y, z")] = None
    pixel_origin: Annotated[
        Literal[0, 1] | None,
        Field(description="what the middle of the first pixel counts as; default: 0, and a question"),
    ] = None
    v_axis: Annotated[
        Literal["down", "up"] | None, Field(description="up: v counts from the bottom of the image; default: down")
    ] = None
    seeds_px: Annotated[dict[str, Pixel], Field(description="id of a dot: where it is seen, six or more")] = {}
    dot_diameter_px: Annotated[float, Field(gt=1, description="size of a dot in the image")] = 9.0

    @model_validator(mode="after")
    def _has_its_columns(self) -> Self:
        needed = ["x_mm", "y_mm", "z_mm", *(["id"] if self.image else ["u_px", "v_px"])]
        wrong = [name for name in needed if self.columns.count(name) != 1]
        if wrong:
            raise ValueError(f"columns: {', '.join(wrong)} must appear once")
        if self.image and not self.seeds_px:
            raise ValueError("seeds_px: dots to be found in an image need seeds")
        if self.image and (self.pixel_origin is not None or self.v_axis is not None):
            raise ValueError("pixel_origin and v_axis are of measured points; here an image is searched for dots")
        return self


class CalibrationEntry(_Entry):
    """Target, planes and points."""

    target: Target | None = None
    origin_px: Annotated[dict[CameraName, Pixel], Field(description="where the target's origin is seen")] = {}
    roll_deg: Annotated[
        dict[CameraName, float], Field(description="how cameras are turned about their axes; 180: upside down")
    ] = {}
    azimuth_deg: Annotated[
        dict[CameraName, float], Field(description="where cameras stand, to 3°; the fit is checked against it")
    ] = {}
    mirrored: Annotated[tuple[CameraName, ...], Field(description="cameras that look by a mirror")] = ()
    scale_px_per_mm: Annotated[
        Positive | dict[CameraName, Positive] | None,
        Field(description="of all images, or by camera, to a tenth; the fit is checked against it"),
    ] = None
    unit: Annotated[
        Literal["mm", "m", "inch", "um"] | None,
        Field(description="what z_mm, pitch_mm and x, y, z of tables are in; default: mm"),
    ] = None
    plane: Annotated[tuple[PlaneEntry, ...], Field(description="images of the target, position by position")] = ()
    points: Annotated[tuple[PointsEntry, ...], Field(description="points instead of images")] = ()

    @model_validator(mode="after")
    def _has_something(self) -> Self:
        if not self.plane and not self.points:
            raise ValueError("neither planes nor points")
        if self.plane and self.target is None:
            raise ValueError("target: planes need a target")
        for key in ("origin_px", "roll_deg", "azimuth_deg", "mirrored", "scales_px_per_mm"):
            if strangers := sorted(set(getattr(self, key)).difference(self.cameras)):
                raise ValueError(f"{key}: there is no camera {', '.join(strangers)}")
        if len({plane.z_mm is None for plane in self.plane}) > 1:
            raise ValueError("plane: some planes have z_mm, others have not; give all of them or none")
        return self

    @property
    def cameras(self) -> tuple[str, ...]:
        """Names of all cameras, in order of appearance."""
        named = [camera for plane in self.plane for camera in plane.images]
        return tuple(dict.fromkeys([*named, *(points.camera for points in self.points)]))

    @property
    def scales_px_per_mm(self) -> dict[str, float]:
        """The scale of every camera of which it is stated."""
        stated = self.scale_px_per_mm
        return stated or {} if isinstance(stated, dict | None) else dict.fromkeys(self.cameras, stated)

    @property
    def unit_mm(self) -> float:
        """What lengths count, in mm."""
        return {"mm": 1.0, "m": 1000.0, "inch": 25.4, "um": 0.001}[self.unit or "mm"]


class SetRecord(_Entry):
    """What ``set.json`` says."""

    schema_name: Annotated[Literal["tomoshadow.calibration_set"], Field(alias="schema")] = SCHEMA
    version: Literal[1] = 1
    source: str
    calibration: CalibrationEntry
