"""Timing of one shot: plan + camera timing model -> ShotTiming. Pure, integer nanoseconds.

Time zero is the start of light pulse A, common to all views. Frame straddling: pulse A ends before
frame A closes, pulse B starts after frame B opens, each with a guard.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from daq.errors import PlanError
from daq.run_plan import PulsePair, RunPlan


@dataclass(frozen=True)
class Window:
    """A span of time, ``open_ns`` <= t < ``close_ns``."""

    open_ns: int
    close_ns: int

    def overlap_ns(self, other: "Window") -> int:
        """Length of the common part of two windows, 0 where there is none."""
        return max(0, min(self.close_ns, other.close_ns) - max(self.open_ns, other.open_ns))


@dataclass(frozen=True)
class CameraTiming:
    """Timing model of a double-frame camera, all in nanoseconds from its trigger edge on.

    Parameters
    ----------
    trigger_delay_ns : int
        Trigger edge to start of exposure A.
    exposure_a_ns : int
        Length of exposure A.
    gap_ns : int
        End of exposure A to start of exposure B: light is lost here.
    exposure_b_ns : int
        Length of exposure B, usually the readout time of A.
    readout_ns : int
        End of exposure B until the next trigger is accepted.
    guard_ns : int
        Distance that light keeps from either frame boundary; covers jitter of the camera.
    """

    trigger_delay_ns: int
    exposure_a_ns: int
    gap_ns: int
    exposure_b_ns: int
    readout_ns: int
    guard_ns: int = 200

    @property
    def frame_a_close_ns(self) -> int:
        """Trigger edge to end of exposure A."""
        return self.trigger_delay_ns + self.exposure_a_ns

    @property
    def frame_b_open_ns(self) -> int:
        """Trigger edge to start of exposure B."""
        return self.frame_a_close_ns + self.gap_ns

    @property
    def cycle_ns(self) -> int:
        """Trigger edge until the next trigger is accepted."""
        return self.frame_b_open_ns + self.exposure_b_ns + self.readout_ns

    def exposures(self, trigger_ns: int) -> tuple[Window, Window]:
        """Exposures A and B of a trigger edge."""
        opened_a_ns, opened_b_ns = trigger_ns + self.trigger_delay_ns, trigger_ns + self.frame_b_open_ns
        return (
            Window(opened_a_ns, opened_a_ns + self.exposure_a_ns),
            Window(opened_b_ns, opened_b_ns + self.exposure_b_ns),
        )

    def has_room_for(self, width_ns: int) -> bool:
        """Whether a pulse and its guards fit into either exposure."""
        return width_ns + 2 * self.guard_ns <= min(self.exposure_a_ns, self.exposure_b_ns)

    def straddling_ns(self, width_ns: int) -> tuple[int, int]:
        """Shortest and longest separation, pulse start to pulse start, that straddles the frame boundary.

        Any shorter one brings a pulse too near to the gap, any longer one a pulse too near to the other end of its
        exposure.
        """
        lit_ns = width_ns + 2 * self.guard_ns
        return lit_ns + self.gap_ns, self.exposure_a_ns + self.gap_ns + self.exposure_b_ns - lit_ns


@dataclass(frozen=True)
class ViewTiming:
    """Edges of one view: camera trigger, both exposures, both pulses; zero is the start of pulse A.

    A pulse B that ends where it begins is none: the light flashes once.
    """

    camera_trigger_ns: int
    frame_a: Window
    frame_b: Window
    pulse_a: Window
    pulse_b: Window
    current_a: float


@dataclass(frozen=True)
class ShotTiming:
    """Timing of all views of a shot, and the shortest period at which it can repeat."""

    views: Mapping[str, ViewTiming]
    shortest_period_ns: int


def plan_shot_timing(plan: RunPlan, cameras: Mapping[str, CameraTiming]) -> ShotTiming:
    """Place camera triggers so that both pulses straddle the frame boundary of every camera.

    Raises
    ------
    PlanError
        The currents do not name exactly the views of the rig, the separation is too short for a
        camera, too long for its exposures, or the rate is too high.
    """
    if set(plan.pulse.current_a) != set(cameras):
        raise PlanError(f"pulse.current_a names views {sorted(plan.pulse.current_a)}, the rig has {sorted(cameras)}")
    views = {name: _view_timing(name, plan.pulse, camera) for name, camera in cameras.items()}
    shortest_ns = max(camera.cycle_ns for camera in cameras.values())
    if plan.rate_hz * shortest_ns > 1e9:
        raise PlanError(f"rate_hz: {plan.rate_hz:g} Hz is above {1e9 / shortest_ns:.4g} Hz, the limit of the cameras")
    return ShotTiming(views, shortest_ns)


def _view_timing(view: str, pulse: PulsePair, camera: CameraTiming) -> ViewTiming:
    _check_straddling(view, pulse, camera)
    trigger_ns = _frame_a_close_ns(pulse, camera) - camera.frame_a_close_ns
    frame_a, frame_b = camera.exposures(trigger_ns)
    return ViewTiming(
        camera_trigger_ns=trigger_ns,
        frame_a=frame_a,
        frame_b=frame_b,
        pulse_a=Window(0, pulse.width_ns),
        pulse_b=Window(pulse.separation_ns, pulse.separation_ns + pulse.width_ns),
        current_a=pulse.current_a[view],
    )


def _check_straddling(view: str, pulse: PulsePair, camera: CameraTiming) -> None:
    if not camera.has_room_for(pulse.width_ns):
        shorter_ns = min(camera.exposure_a_ns, camera.exposure_b_ns)
        raise PlanError(f"pulse.width_ns: {pulse.width_ns} ns does not fit the exposure of {view}, {shorter_ns} ns")
    shortest_ns, longest_ns = camera.straddling_ns(pulse.width_ns)
    if pulse.separation_ns < shortest_ns:
        raise PlanError(
            f"pulse.separation_ns: {pulse.separation_ns} ns is below {shortest_ns} ns, the limit of camera {view} "
            f"(width {pulse.width_ns} + gap {camera.gap_ns} + 2 x guard {camera.guard_ns} ns)"
        )
    if pulse.separation_ns > longest_ns:
        raise PlanError(
            f"pulse.separation_ns: {pulse.separation_ns} ns is above {longest_ns} ns, the limit of camera {view} "
            f"(exposures {camera.exposure_a_ns} and {camera.exposure_b_ns} ns)"
        )


def _frame_a_close_ns(pulse: PulsePair, camera: CameraTiming) -> int:
    """Midway between both pulses where the exposures are long enough, else as near to it as they allow."""
    midway_ns = (pulse.width_ns + pulse.separation_ns - camera.gap_ns) // 2
    latest_ns = camera.exposure_a_ns - camera.guard_ns
    pulse_b_end_ns = pulse.separation_ns + pulse.width_ns
    earliest_ns = pulse_b_end_ns + camera.guard_ns - camera.gap_ns - camera.exposure_b_ns
    return max(earliest_ns, min(midway_ns, latest_ns))
