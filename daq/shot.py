"""Shot and DoubleFrame: one firing, seen by all views. Values only; ``daq.files.run_directory`` stores them."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from daq.run_plan import ImageKey

Image = NDArray[np.uint8] | NDArray[np.uint16]


@dataclass(frozen=True)
class ExposureRecord:
    """What the camera said of one exposure.

    Parameters
    ----------
    valid : bool
        The exposure arrived complete and belongs to this shot.
    frame_id : int
        Frame id of the camera (16 bit, 1 to 65535); 0 where the exposure is missing.
    device_timestamp_ns : int
        Camera clock at the exposure; 0 where missing.
    missing_packets, resent_packets : int
        Network packets that never came, and that came on the second request.
    """

    valid: bool
    frame_id: int = 0
    device_timestamp_ns: int = 0
    missing_packets: int = 0
    resent_packets: int = 0


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
    """

    frame_a: Image
    frame_b: Image | None
    record_a: ExposureRecord
    record_b: ExposureRecord

    @property
    def valid(self) -> bool:
        """Both exposures (or the only one) are complete."""
        return self.record_a.valid and (self.frame_b is None or self.record_b.valid)


@dataclass(frozen=True)
class LightPulse:
    """One light pulse as it was fired; zero is the trigger of the shot."""

    start_ns: int
    width_ns: int
    current_a: float


@dataclass(frozen=True)
class FiredTrain:
    """The pulse train of one shot as the generator quantised and fired it.

    Parameters
    ----------
    sequence : int
        Trigger sequence number, counted by the generator.
    camera_trigger_ns : Mapping[str, int]
        Rising edge of each view's camera trigger; zero is the trigger of the shot.
    pulses : Mapping[str, tuple[LightPulse, ...]]
        Light pulses of each view; empty for a dark exposure.
    """

    sequence: int
    camera_trigger_ns: Mapping[str, int] = field(default_factory=dict)
    pulses: Mapping[str, tuple[LightPulse, ...]] = field(default_factory=dict)


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
    """

    index: int
    image_key: ImageKey
    views: Mapping[str, DoubleFrame]
    fired: FiredTrain | None = None
    host_time_ns: int = 0
    stage_z_mm: float | None = None

    @property
    def valid(self) -> bool:
        """Every exposure of every view is complete."""
        return self.image_key is not ImageKey.INVALID and all(view.valid for view in self.views.values())
