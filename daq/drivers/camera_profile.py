"""Camera profile: what a double-frame camera must be told, in which order, and when it then exposes.

No standard feature names a double-frame mode, and some cameras mind the order in which trigger features
are written. So a profile is an ordered list of writes, each of which is read back, and a timing model.
"""

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, ValidationError, model_validator

from daq.errors import PlanError
from daq.frozen_model import FrozenModel
from daq.timing import CameraTiming

FeatureValue = bool | int | float | str
_Nanoseconds = Annotated[int, Field(ge=0, le=10_000_000_000)]


class FeatureWrite(FrozenModel):
    """One GenICam feature, the value it gets, and how closely it must read back."""

    feature: Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$", description="GenICam name")]
    value: Annotated[FeatureValue, Field(description="bool, integer, float or enumeration entry, as the feature is")]
    tolerance: Annotated[float, Field(ge=0, description="largest difference of a number that reads back")] = 0.0

    def is_met_by(self, actual: FeatureValue) -> bool:
        """True if the value that was read back will do."""
        if isinstance(self.value, int | float) and isinstance(actual, int | float):
            return abs(actual - self.value) <= self.tolerance
        return actual == self.value


class TimingModel(FrozenModel):
    """Timing of the exposures from the trigger edge on; the fields of ``CameraTiming``."""

    trigger_delay_ns: Annotated[_Nanoseconds, Field(description="trigger edge to start of exposure A")]
    exposure_a_ns: Annotated[_Nanoseconds, Field(description="length of exposure A")]
    gap_ns: Annotated[_Nanoseconds, Field(description="end of exposure A to start of exposure B")]
    exposure_b_ns: Annotated[_Nanoseconds, Field(description="length of exposure B")]
    readout_ns: Annotated[_Nanoseconds, Field(description="end of exposure B until the next trigger is accepted")]
    guard_ns: Annotated[_Nanoseconds, Field(description="distance that light keeps from a frame boundary")] = 200


class PairSpacing(FrozenModel):
    """Device time from exposure A to exposure B, as the camera stamps them; proves that both are one pair."""

    spacing_ns: Annotated[_Nanoseconds, Field(description="timestamp of B minus timestamp of A")]
    tolerance_ns: Annotated[_Nanoseconds, Field(description="largest deviation of a pair")]


class CameraProfile(FrozenModel):
    """Settings and timing of one camera model in double-frame operation."""

    model: Annotated[str, Field(min_length=1, description="camera this was written for")]
    pixel_format: Annotated[
        Literal["Mono8", "Mono10", "Mono12", "Mono14", "Mono16"],
        Field(description="unpacked grey values of so many bits"),
    ]
    frames_per_trigger: Annotated[Literal[1, 2], Field(description="exposures that one trigger edge starts")] = 2
    features: Annotated[tuple[FeatureWrite, ...], Field(description="written in this order, then read back")]
    timing: TimingModel
    pair: Annotated[PairSpacing | None, Field(description="None: one exposure, or stamps that tell nothing")] = None
    stacked: Annotated[bool, Field(description="A and B come as one image of twice the height, A above B")] = False

    @model_validator(mode="after")
    def _stacked_exposures_are_a_pair(self) -> Self:
        if self.stacked and (self.frames_per_trigger != 2 or self.pair is not None):
            raise ValueError("stacked exposures are two per trigger, and one image has one stamp: leave out pair")
        return self

    def writes(self, shape: tuple[int, int], has: Callable[[str], bool]) -> list[FeatureWrite]:
        """All that a camera is told: size (rows, columns) and format unless it says otherwise, then what it says."""
        rows, columns = shape
        offsets = [FeatureWrite(feature=name, value=0) for name in ("OffsetX", "OffsetY") if has(name)]
        image = [
            FeatureWrite(feature="Width", value=columns),
            FeatureWrite(feature="Height", value=rows),
            FeatureWrite(feature="PixelFormat", value=self.pixel_format),
        ]
        named = {setting.feature for setting in self.features}
        return [*(setting for setting in (*offsets, *image) if setting.feature not in named), *self.features]

    @property
    def bits(self) -> int:
        """Significant bits of a grey value."""
        return int(self.pixel_format.removeprefix("Mono"))

    @property
    def camera_timing(self) -> CameraTiming:
        """Timing model as the planner wants it."""
        return CameraTiming(**self.timing.model_dump())


def load_camera_profile(path: Path) -> CameraProfile:
    """Read a profile from TOML.

    Raises
    ------
    PlanError
        The file is absent, is not TOML, or a key is unknown, missing or out of range; names file and key.
    """
    try:
        return CameraProfile.model_validate(tomllib.loads(path.read_text("utf-8")))
    except OSError as error:
        raise PlanError(f"{path}: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise PlanError(f"{path}: {error}") from error
    except ValidationError as error:
        raise PlanError(f"{path}: {_first_fault(error)}") from error


def _first_fault(error: ValidationError) -> str:
    fault = error.errors(include_url=False)[0]
    key = ".".join(str(part) for part in fault["loc"])
    return f"{key}: {fault['msg']}, got {fault['input']!r}"
