"""The import manifest: which images from elsewhere are what. TOML; errors name file and line."""

import os
import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError, field_validator, model_validator

from daq.files.run_directory import RunNotes, Spray
from processing.calibration.sets.set_record import CalibrationEntry, CameraName
from processing.errors import BadInput
from processing.kernels import _native
from processing.runs.manifest.image_pattern import ImagePattern
from processing.runs.toml_lines import Key, line_of

_VARIABLE = re.compile(r"^\$(\w+|\{\w+\})")

MAX_SHOTS = 100_000
"""Of one pattern: what is beyond is a slip of the pen."""

LEAST_SEPARATION_NS, MOST_SEPARATION_NS = 40, 10_000_000_000
"""From the shortest gap of a camera for double exposures to what is no pair any more."""
NS_PER_S = 1_000_000_000

Images = Annotated[dict[CameraName, str], Field(min_length=1, max_length=_native.MAX_VIEWS)]


class ManifestError(BadInput):
    """A manifest, or a file that it names, is wrong; the text names file and line."""


class _Entry(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


Page = Annotated[int | None, Field(ge=0, description="which image of a stack, counted from 0; of frame_b too")]
PageB = Annotated[int | None, Field(ge=0, description="which image of the stack that frame_b is in; default: as page")]


class ShotEntry(_Entry):
    """One exposure or two of all cameras."""

    frame_a: Annotated[Images, Field(description="image file of every camera")]
    frame_b: Annotated[Images | None, Field(description="the second exposure; all shots have it, or none")] = None
    page: Page = None
    page_b: PageB = None

    @property
    def frames(self) -> tuple[Images, ...]:
        """Exposure A, and B where there is one."""
        return (self.frame_a,) if self.frame_b is None else (self.frame_a, self.frame_b)


class ShotsEntry(_Entry):
    """Many shots of all cameras, by a pattern of their file names."""

    frame_a: Annotated[
        str | None,
        Field(description="file name with {view} and {shot:04d}; without {shot} the pages of a stack are the shots"),
    ] = None
    frame_b: Annotated[
        str | None, Field(description="the second exposure; where it is the same stack, its pages are A, B, A, B, ...")
    ] = None
    frames: Annotated[str | None, Field(description="in place of frame_a and frame_b: single exposures")] = None
    shots: Annotated[
        tuple[int, int] | None, Field(description="first and last number, both are taken; default: all that are there")
    ] = None
    views: Annotated[
        tuple[CameraName, ...] | None,
        Field(min_length=2, description="cameras; default: as other shots, as [calibration], or all that are there"),
    ] = None
    page: Page = None
    page_b: PageB = None

    @model_validator(mode="after")
    def _is_a_pattern(self) -> Self:
        if (self.frames is None) == (self.frame_a is None) or None not in (self.frames, self.frame_b):
            raise ValueError("either frame_a, with or without frame_b, or frames for single exposures")
        if len({pattern.counts_shots for pattern in self.patterns.values()}) > 1:
            raise ValueError("frame_b: both exposures have {shot} in their names, or none")
        if not self.counts_shots and (self.page, self.page_b) != (None, None):
            raise ValueError("page: the pages of a stack are its shots where {shot} is not in its name")
        if self.shots is not None and not 0 <= self.shots[0] <= self.shots[1]:
            raise ValueError(f"shots: {list(self.shots)} are not the first number and the last, from 0 on")
        if self.shots is not None and self.shots[1] - self.shots[0] >= MAX_SHOTS:
            raise ValueError(f"shots: {list(self.shots)} are more than {MAX_SHOTS}")
        return self

    @property
    def patterns(self) -> dict[str, ImagePattern]:
        """By key: of exposure A, and B where there is one."""
        texts = {"frames": self.frames, "frame_a": self.frame_a, "frame_b": self.frame_b}
        return {key: ImagePattern(text) for key, text in texts.items() if text is not None}

    @property
    def counts_shots(self) -> bool:
        """Whether every shot has files of its own; else the pages of one file are the shots."""
        return next(iter(self.patterns.values())).counts_shots


class RunEntry(_Entry):
    """Shots that become a run."""

    polarity: Annotated[
        Literal["shadow", "bright"], Field(description="dark droplets before light, or bright particles on black")
    ]
    bits: Annotated[
        int | None, Field(ge=8, le=16, description="of a grey value in files of 16 bit, 12 if they reach to 4095")
    ] = None
    separation_ns: Annotated[
        int | None,
        Field(description="from exposure A to B, from 40 ns to 10 s and within 1 / rate_hz; kept with the run"),
    ] = None
    rate_hz: Annotated[
        FiniteFloat | None, Field(gt=0, description="shots per second, all alike; kept with the run")
    ] = None
    double_height: Annotated[bool, Field(description="every image is exposure A above exposure B")] = False
    notes: Annotated[RunNotes, Field(description="conditions of the run; kept with it")] = RunNotes()
    shot: Annotated[tuple[ShotEntry, ...], Field(description="the shots, in order")] = ()
    shots: Annotated[tuple[ShotsEntry, ...], Field(description="more of them, by patterns of file names")] = ()
    background: Annotated[tuple[ShotEntry, ...], Field(description="light without spray; their mean is used")] = ()
    backgrounds: Annotated[tuple[ShotsEntry, ...], Field(description="more of them, by patterns of file names")] = ()
    dark: Annotated[tuple[ShotEntry, ...], Field(description="without light; their mean is used")] = ()
    darks: Annotated[tuple[ShotsEntry, ...], Field(description="more of them, by patterns of file names")] = ()

    @model_validator(mode="after")
    def _shots_agree(self) -> Self:
        if not self.shot and not self.shots:
            raise ValueError("neither shot nor shots")
        self._require_separation()
        cameras = set(self.shot[0].frame_a) if self.shot else None
        if cameras is not None and len(cameras) < 2:
            raise ValueError(f"shot: {len(cameras)} camera, a run has 2 to {_native.MAX_VIEWS}")
        single = self.frames_per_shot == 1 or self.double_height
        for kind in ("shot", "shots", "background", "backgrounds", "dark", "darks"):
            entries: tuple[ShotEntry | ShotsEntry, ...] = getattr(self, kind)
            for number, entry in enumerate(entries, start=1):
                if self.double_height and entry.frame_b is not None:
                    raise ValueError(f"{kind} {number}: with double_height exposure B is below A, not in frame_b")
                if (entry.frame_b is None) != single:
                    raise ValueError(f"{kind} {number}: all of them have frame_b, or none")
        return self

    @field_validator("separation_ns")
    @classmethod
    def _is_possible(cls, separation_ns: int | None) -> int | None:
        if separation_ns is not None and not LEAST_SEPARATION_NS <= separation_ns <= MOST_SEPARATION_NS:
            raise ValueError(
                f"no camera takes exposures {separation_ns} ns apart, but {LEAST_SEPARATION_NS} ns to 10 s; "
                "6400 is 6.4 us"
            )
        return separation_ns

    def _require_separation(self) -> None:
        separation_ns = self.separation_ns
        if separation_ns is None:
            return
        if self.frames_per_shot == 1:
            raise ValueError("separation_ns: shots have one exposure; a series in time has rate_hz")
        if self.rate_hz is not None and separation_ns * self.rate_hz >= NS_PER_S:
            raise ValueError(
                f"separation_ns: {separation_ns} ns is no shorter than a shot of rate_hz = {self.rate_hz:g}, "
                f"{NS_PER_S / self.rate_hz:.4g} ns"
            )

    @property
    def frames_per_shot(self) -> Literal[1, 2]:
        """2: exposures A and B."""
        first = self.shot[0] if self.shot else self.shots[0]
        return 2 if self.double_height or first.frame_b is not None else 1


class Manifest(_Entry):
    """A whole manifest."""

    root: Annotated[
        str | None,
        Field(description="folder that paths start from, may begin with $VARIABLE; default: that of the manifest"),
    ] = None
    calibration: CalibrationEntry | None = None
    run: RunEntry | None = None
    spray: Annotated[Spray | None, Field(description="where nozzle and axis are; kept with the run")] = None

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
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise ManifestError(f"{path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ManifestError(f"{path}: not UTF-8: byte {error.start} is {error.object[error.start]:#x}") from error
    try:
        manifest = Manifest.model_validate(tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise ManifestError(f"{path}: {error}") from error
    except ValidationError as error:
        unknown_first = sorted(error.errors(), key=lambda problem: problem["type"] != "extra_forbidden")
        first = unknown_first[0]
        raise _error(path, text, first["loc"], _problem(first["type"], first["msg"])) from error
    return ManifestFile(path, text, manifest, _root(path, text, manifest.root))


def named_files(manifest: Manifest) -> Iterator[tuple[Key, str]]:
    """Key and name of every file of a calibration; for those of a run see ``processing.runs.manifest.shot_sources``."""
    if manifest.calibration is not None:
        for number, plane in enumerate(manifest.calibration.plane):
            for camera, file in plane.images.items():
                yield ("calibration", "plane", number, "images", camera), file
        for number, points in enumerate(manifest.calibration.points):
            yield ("calibration", "points", number, "file"), points.file
            if points.image is not None:
                yield ("calibration", "points", number, "image"), points.image


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


def _problem(kind: str, message: str) -> str:
    texts = {
        "extra_forbidden": "there is no such key here; is it misspelt? docs/rig-file.md lists all keys",
        "missing": "this key is missing",
    }
    return texts.get(kind, message.removeprefix("Value error, "))


def _error(path: Path, text: str, key: Key, problem: str) -> ManifestError:
    line = line_of(text, key)
    where = f"{path}, line {line}" if line else str(path)
    name = ".".join(str(part) for part in key)
    return ManifestError(f"{where}: {name}: {problem}" if name else f"{where}: {problem}")
