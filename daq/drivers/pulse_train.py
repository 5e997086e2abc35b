"""Pulse trains between the two clocks: edges that count from pulse A, and what the generator says of its own. Pure.

``ShotTiming`` counts from the start of pulse A, so camera triggers can be negative; the generator counts from
the trigger of the shot, where nothing can be. All edges are shifted by the same whole number of ticks.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from daq.drivers.pulse_protocol import Reply
from daq.shot import FiredTrain, LightPulse
from daq.timing import ShotTiming


@dataclass(frozen=True)
class LoadedTrain:
    """The train that the generator holds: its number there, its shortest period, and its actual edges."""

    number: int
    period_us: int
    actual: FiredTrain


def shift_ns(timing: ShotTiming, tick_ns: int) -> int:
    """Start of pulse A after the trigger of the shot: whole ticks, so that it is quantised without error."""
    earliest_ns = min(min(view.camera_trigger_ns, view.pulse_a.open_ns) for view in timing.views.values())
    return -(min(0, earliest_ns) // tick_ns) * tick_ns


def actual_train(replies: Mapping[str, Reply]) -> FiredTrain:
    """The train that the generator has loaded, sequence 0."""
    return FiredTrain(
        sequence=0,
        camera_trigger_ns={view: reply.number("camera_ns") for view, reply in replies.items()},
        pulses={view: pulses_of(reply, "ns", 1) for view, reply in replies.items()},
    )


def pulses_of(reply: Reply, unit: str, unit_ns: int) -> tuple[LightPulse, ...]:
    """Pulses of a channel that has current; one of no width is none."""
    current_a = reply.number("current_ma") / 1000
    edges = ((reply.number(f"{pulse}_start_{unit}"), reply.number(f"{pulse}_width_{unit}")) for pulse in "ab")
    return tuple(
        LightPulse(start * unit_ns, width * unit_ns, current_a) for start, width in edges if current_a and width
    )
