"""The import manifest: which images from elsewhere are what. TOML; errors name file and line."""

import os
import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from processing.calibration.sets.set_record import CalibrationEntry, CameraName
from processing.errors import BadInput
from processing.kernels import _native
from processing.runs.toml_lines import Key, line_of

_VARIABLE = re.compile(r"^\$(\w+|\{\w+\})")

Images = Annotated[dict[CameraName, str], Field(min_length=1, max_length=_native.MAX_VIEWS)]


class ManifestError(BadInput):
    """A manifest, or a file that it names, is wrong; the text names file and line."""


class _Entry(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class ShotEntry(_Entry):
    """One exposure or two of all cameras."""

    frame_a: Annotated[Images, Field(description="image file of every camera")]
    frame_b: Annotated[Images | None, Field(description="the second exposure; all shots have it, or none")] = None

    @property
    def frames(self) -> tuple[Images, ...]:
        """Exposure A, and B where there is one."""
        return (self.frame_a,) if self.frame_b is None else (self.frame_a, self.frame_b)


class RunEntry(_Entry):
    """Shots that become a run."""

    polarity: Annotated[
        Literal["shadow", "bright"], Field(description="dark droplets before light, or bright particles on black")
    ]
    separation_ns: Annotated[int | None, Field(gt=0, description="from exposure A to B; kept with the run")] = None
    shot: Annotated[tuple[ShotEntry, ...], Field(min_length=1, description="the shots, in order")]
    background: Annotated[tuple[ShotEntry, ...], Field(description="light without spray; their mean is used")] = ()
    dark: Annotated[tuple[ShotEntry, ...], Field(description="without light; their mean is used")] = ()

    @model_validator(mode="after")
    def _shots_agree(self) -> Self:
        first = self.shot[0]
        cameras = set(first.frame_a)
        if len(cameras) < 2:
            raise ValueError(f"shot: {len(cameras)} camera, a run has 2 to {_native.MAX_VIEWS}")
        for kind in ("shot", "background", "dark"):
            entries: tuple[ShotEntry, ...] = getattr(self, kind)
            for number, entry in enumerate(entries):
                if any(set(images) != cameras for images in entry.frames):
                    raise ValueError(f"{kind} {number + 1}: cameras differ from {', '.join(sorted(cameras))}")
                if len(entry.frames) != len(first.frames):
                    raise ValueError(f"{kind} {number + 1}: all of them have frame_b, or none")
        return self


class Manifest(_Entry):
    """A whole manifest."""

    root: Annotated[
        str | None,
        Field(description="folder that paths start from, may begin with $VARIABLE; default: that of the manifest"),
    ] = None
    calibration: CalibrationEntry | None = None
    run: RunEntry | None = None

    @model_validator(mode="after")
    def _has_something(self) -> Self:
        if self.calibration is None and self.run is None:
            raise ValueError("neither [calibration] nor [run]")
        if self.calibration is not None and len(self.calibration.cameras) > _native.MAX_VIEWS:
            raise ValueError(f"calibration: {len(self.calibration.cameras)} cameras, {_native.MAX_VIEWS} are possible")
        return self


@dataclass(frozen=True)
class ManifestFile:
    """A manifest as it was read: values, text for line numbers, and the folder that paths start from."""

    path: Path
    text: str
    manifest: Manifest
    root: Path

    def resolve(self, file: str) -> Path:
        """Path of a file that the manifest names."""
        return self.root / file

    def error(self, key: Key, problem: str) -> ManifestError:
        """Error that names the line of a key."""
        return _error(self.path, self.text, key, problem)


def read_manifest(path: Path) -> ManifestFile:
    """Read and check a manifest; the files it names are not touched.

    Raises
    ------
    ManifestError
        Names file and line.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ManifestError(f"{path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ManifestError(f"{path}: not UTF-8: byte {error.start} is {error.object[error.start]:#x}") from error
    try:
        manifest = Manifest.model_validate(tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise ManifestError(f"{path}: {error}") from error
    except ValidationError as error:
        first = error.errors()[0]
        raise _error(path, text, first["loc"], first["msg"].removeprefix("Value error, ")) from error
    return ManifestFile(path, text, manifest, _root(path, text, manifest.root))


def named_files(manifest: Manifest) -> Iterator[tuple[Key, str]]:
    """Key and name of every file that a manifest names."""
    if manifest.calibration is not None:
        for number, plane in enumerate(manifest.calibration.plane):
            for camera, file in plane.images.items():
                yield ("calibration", "plane", number, "images", camera), file
        for number, points in enumerate(manifest.calibration.points):
            yield ("calibration", "points", number, "file"), points.file
            if points.image is not None:
                yield ("calibration", "points", number, "image"), points.image
    if manifest.run is not None:
        for kind in ("shot", "background", "dark"):
            for number, entry in enumerate(getattr(manifest.run, kind)):
                yield from _shot_files(("run", kind, number), entry)


def _shot_files(key: Key, entry: ShotEntry) -> Iterator[tuple[Key, str]]:
    for frame, images in zip(("frame_a", "frame_b"), entry.frames, strict=False):
        for camera, file in images.items():
            yield (*key, frame, camera), file


def _root(path: Path, text: str, root: str | None) -> Path:
    if root is None:
        return path.parent
    variable = _VARIABLE.match(root)
    if variable is None:
        return path.parent / root
    name = variable[1].strip("{}")
    if name not in os.environ:
        raise _error(path, text, ("root",), f"the environment variable {name} is not set")
    return Path(os.environ[name] + root[variable.end() :])


def _error(path: Path, text: str, key: Key, problem: str) -> ManifestError:
    line = line_of(text, key)
    where = f"{path}, line {line}" if line else str(path)
    name = ".".join(str(part) for part in key)
    return ManifestError(f"{where}: {name}: {problem}" if name else f"{where}: {problem}")
