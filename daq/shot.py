"""Shot and DoubleFrame: one firing, seen by all views. Values only; ``daq.files.run_directory`` stores them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from daq.run_plan import ImageKey

Image = NDArray[np.uint8] | NDArray[np.uint16]


class Flaw(IntEnum):
    """What is wrong with an exposure. The first four did not arrive as they should, the others have the wrong light."""

    NONE = 0
    LOST = 1
    """Nothing came before the deadline; what comes later is counted as ``late_frames`` of a later shot."""
    INCOMPLETE = 2
    """Packets of it never came."""
    WRONG_SIZE = 3
    """It came with other rows or columns than the camera was told."""
    UNPROVEN = 4
    """It came, but nothing proves that it is this exposure of this shot: swapped, a neighbour lost, too many frames."""
    DARK = 5
    """It shows no light although its view was lit."""
    DOUBLY_LIT = 6
    """It shows far more light than its background."""


@dataclass(frozen=True)
class ExposureRecord:
    """What the camera said of one exposure."""

    valid: Annotated[bool, Field(description="it arrived complete and belongs to this shot")]
    frame_id: Annotated[int, Field(description="16 bit, 1 to 65535; 0 where the exposure is missing")] = 0
    device_timestamp_ns: Annotated[int, Field(description="camera clock at the exposure; 0 where missing")] = 0
    missing_packets: Annotated[int, Field(description="network packets that never came")] = 0
    resent_packets: Annotated[int, Field(description="network packets that came on the second request")] = 0
    flaw: Annotated[
        Flaw,
        Field(
            description="0: none; 1: lost; 2: incomplete; 3: of wrong size; 4: not proven to be this one; 5: dark; 6: "
            "doubly lit"
        ),
    ] = Flaw.NONE


@dataclass(frozen=True)
class DoubleFrame:
    """Exposures A and B of one view.

    Parameters
    ----------
    frame_a, frame_b : Image
        Grey values, (row, column), uint8 or uint16. Zeros where the exposure is missing: a missing
        exposure keeps its slot. ``frame_b`` is None in runs with single exposures.
    record_a, record_b : ExposureRecord
        What the camera said of each.
    late_frames : int
        Frames of earlier shots that came since the one before this.
    """

    frame_a: Image
    frame_b: Image | None
    record_a: ExposureRecord
    record_b: ExposureRecord
    late_frames: int = 0

    @property
    def valid(self) -> bool:
        """Both exposures (or the only one) are complete."""
        return self.record_a.valid and (self.frame_b is None or self.record_b.valid)

    @property
    def silent(self) -> bool:
        """Nothing of the firing arrived whole."""
        return not (self.record_a.valid or self.record_b.valid)


@dataclass(frozen=True)
class LightPulse:
    """One light pulse as it was fired; zero is the trigger of the shot."""

    start_ns: Annotated[int, Field(description="rising edge")]
    width_ns: Annotated[int, Field(description="duration")]
    current_a: Annotated[float, Field(description="peak current of the LED")]


@dataclass(frozen=True)
class FiredTrain:
    """The pulse train of one shot as the generator quantised and fired it."""

    sequence: Annotated[int, Field(description="trigger sequence number, counted by the generator")]
    camera_trigger_ns: Annotated[
        Mapping[str, int], Field(description="rising edge of each camera trigger; zero is the trigger of the shot")
    ] = field(default_factory=dict)
    pulses: Annotated[
        Mapping[str, tuple[LightPulse, ...]], Field(description="light pulses by view; none for a dark exposure")
    ] = field(default_factory=dict)


@dataclass(frozen=True)
class Shot:
    """One firing of the light, all views.

    Parameters
    ----------
    index : int
        Position in the run, from 0; never shifts.
    image_key : ImageKey
        What it shows; INVALID where an exposure is missing or dark by mistake.
    views : Mapping[str, DoubleFrame]
        Exposures by view.
    fired : FiredTrain | None
        The actual pulse train; None for imported images.
    host_time_ns : int
        Unix time of the firing; 0 for imported images.
    stage_z_mm : float | None
        Position of the calibration target, where there is one.
    refires : int
        How often it was fired before, with an exposure missing each time; their sequence numbers were given up.
    period_ns : int
        Time since the firing before, of whatever shot, by a clock that nobody sets; 0 for the first one.
    clock_step_ns : int
        By how much the host's clock was set since then, against that clock.
    """

    index: int
    image_key: ImageKey
    views: Mapping[str, DoubleFrame]
    fired: FiredTrain | None = None
    host_time_ns: int = 0
    stage_z_mm: float | None = None
    refires: int = 0
    period_ns: int = 0
    clock_step_ns: int = 0

    @property
    def valid(self) -> bool:
        """Every exposure of every view is complete."""
        return self.image_key is not ImageKey.INVALID and all(view.valid for view in self.views.values())
