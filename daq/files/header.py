"""RunHeader: everything a run says of itself before its first shot."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from daq.frozen_model import FrozenModel
from daq.names import ViewName
from daq.run_plan import RunPlan


@dataclass(frozen=True)
class ViewFormat:
    """How the frames of one view are stored.

    Parameters
    ----------
    shape : tuple[int, int]
        (rows, columns).
    bits : int
        Significant bits of a grey value, 8 to 16.
    """

    shape: tuple[Annotated[int, Field(ge=1)], Annotated[int, Field(ge=1)]]
    bits: Annotated[int, Field(ge=8, le=16)]

    @property
    def dtype(self) -> np.dtype[Any]:
        """Number type of the stored frames: uint8 for 8 bits, else little-endian uint16."""
        return np.dtype("u1" if self.bits == 8 else "<u2")

    @property
    def frame_bytes(self) -> int:
        """Size of one uncompressed frame."""
        return self.shape[0] * self.shape[1] * self.dtype.itemsize


class RunHeader(FrozenModel):
    """What a run is, written before its first shot and never changed.

    Parameters
    ----------
    run_id : str
        Name of the run directory.
    created_utc : str
        ISO 8601, UTC.
    views : dict[str, ViewFormat]
        One to eight views; sizes and bit depths may differ.
    frames_per_shot : {1, 2}
        2: exposures A and B; 1: single exposures.
    plan : RunPlan | None
        None for imported images.
    configuration : dict
        The resolved configuration of the rig, JSON.
    devices : dict[str, dict[str, str]]
        Vendor, model, serial and firmware by device name.
    software : dict[str, str]
        Versions by package.
    calibration_id, calibration_sha256 : str | None
        The calibration that belongs to this run.
    polarity : {"shadow", "bright"}
        Dark objects before light, or bright ones before dark.
    separation_ns : int | None
        Time between exposures A and B; None for single exposures.
    """

    run_id: Annotated[str, Field(min_length=1)]
    created_utc: str
    views: Annotated[dict[ViewName, ViewFormat], Field(min_length=1, max_length=8)]
    frames_per_shot: Literal[1, 2] = 2
    plan: RunPlan | None = None
    configuration: dict[str, Any] = Field(default_factory=dict)
    devices: dict[str, dict[str, str]] = Field(default_factory=dict)
    software: dict[str, str] = Field(default_factory=dict)
    calibration_id: str | None = None
    calibration_sha256: str | None = None
    polarity: Literal["shadow", "bright"] = "shadow"
    separation_ns: int | None = None

    @property
    def shot_bytes(self) -> int:
        """Size of one uncompressed shot."""
        return self.frames_per_shot * sum(view.frame_bytes for view in self.views.values())
