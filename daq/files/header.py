"""RunHeader: everything a run says of itself before its first shot; RunClosing: what is said after its last one."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from daq.causes import Cause
from daq.frozen_model import FrozenModel
from daq.names import ViewName
from daq.run_notes import RunNotes, Spray
from daq.run_plan import RunPlan


@dataclass(frozen=True)
class ViewFormat:
    """How the frames of one view are stored."""

    shape: Annotated[
        tuple[Annotated[int, Field(ge=1)], Annotated[int, Field(ge=1)]], Field(description="(rows, columns)")
    ]
    bits: Annotated[int, Field(ge=8, le=16, description="significant bits of a grey value")]

    @property
    def dtype(self) -> np.dtype[Any]:
        """Number type of the stored frames: uint8 for 8 bits, else little-endian uint16."""
        return np.dtype("u1" if self.bits == 8 else "<u2")

    @property
    def frame_bytes(self) -> int:
        """Size of one uncompressed frame."""
        return self.shape[0] * self.shape[1] * self.dtype.itemsize


class RunHeader(FrozenModel):
    """What a run is, written before its first shot and never changed; devices are added when they have answered."""

    run_id: Annotated[str, Field(min_length=1, description="name of the run directory")]
    created_utc: Annotated[str, Field(description="ISO 8601, UTC")]
    views: Annotated[
        dict[ViewName, ViewFormat],
        Field(min_length=1, max_length=8, description="how the frames of each view are stored; sizes may differ"),
    ]
    frames_per_shot: Annotated[Literal[1, 2], Field(description="2: exposures A and B; 1: single exposures")] = 2
    plan: Annotated[RunPlan | None, Field(description="as the operator wrote it; null for imported images")] = None
    configuration: Annotated[dict[str, Any], Field(description="the resolved configuration of the rig")] = Field(
        default_factory=dict
    )
    devices: Annotated[
        dict[str, dict[str, str]], Field(description="vendor, model, serial and firmware by device name")
    ] = Field(default_factory=dict)
    software: Annotated[dict[str, str], Field(description="versions by package")] = Field(default_factory=dict)
    calibration_id: Annotated[str | None, Field(description="the calibration that belongs to this run")] = None
    calibration_sha256: Annotated[str | None, Field(description="SHA-256 of its file when the run started")] = None
    polarity: Annotated[
        Literal["shadow", "bright"], Field(description="dark objects before light, or bright ones before dark")
    ] = "shadow"
    separation_ns: Annotated[
        int | None, Field(description="time between exposures A and B; null for single exposures")
    ] = None
    rate_hz: Annotated[float | None, Field(description="of shots at even times; null where nobody stated it")] = None
    notes: Annotated[RunNotes, Field(description="conditions that no device knows")] = RunNotes()
    spray: Annotated[Spray | None, Field(description="where nozzle and axis are; null where nobody stated it")] = None

    @property
    def shot_bytes(self) -> int:
        """Size of one uncompressed shot."""
        return self.frames_per_shot * sum(view.frame_bytes for view in self.views.values())


@dataclass(frozen=True)
class RunClosing:
    """How a run ended.

    Parameters
    ----------
    outcome : str
        A value of ``daq.run.state.RunOutcome``.
    cause : str
        Why; empty if it was completed.
    ended_utc : str
        ISO 8601, UTC.
    causes : tuple[Cause, ...]
        All reasons with their codes, the first one first; empty where none was kept, as in runs from before.
    unstored : tuple[int, ...]
        Shots that were fired and are not on the disk.
    """

    outcome: str
    cause: str
    ended_utc: str
    causes: tuple[Cause, ...] = ()
    unstored: tuple[int, ...] = ()
