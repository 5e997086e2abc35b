"""The light path of the simulated laboratory: what was fired, and what an exposure integrates of it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from daq.shot import FiredTrain, Image, LightPulse
from daq.timing import CameraTiming, Window


@dataclass(frozen=True)
class CollectedPulse:
    """The part of a light pulse that falls into one exposure; ``start_ns`` counts from the trigger of the shot."""

    start_ns: int
    collected_ns: int
    current_a: float


@dataclass(frozen=True)
class Exposure:
    """One exposure that a simulated camera asks its scene to render.

    Parameters
    ----------
    view : str
        Name of the view.
    sequence : int
        Sequence number of the firing: the scene is keyed by it, never by a per-camera counter.
    frame : {"A", "B"}
        Which of the two exposures.
    window : Window
        When it is open; zero is the trigger of the shot.
    pulses : tuple[CollectedPulse, ...]
        The light that really fell into it: none for a dark frame, two for a doubly exposed one.
    shape : tuple[int, int]
        (rows, columns).
    bits : int
        Significant bits of a grey value.
    """

    view: str
    sequence: int
    frame: Literal["A", "B"]
    window: Window
    pulses: tuple[CollectedPulse, ...]
    shape: tuple[int, int]
    bits: int


FrameSource = Callable[[Exposure], Image]


def exposures_of(
    train: FiredTrain, view: str, timing: CameraTiming, shape: tuple[int, int], bits: int
) -> tuple[Exposure, Exposure]:
    """Exposures A and B of a camera whose trigger line saw this train."""
    window_a, window_b = timing.exposures(train.camera_trigger_ns[view])
    pulses = train.pulses.get(view, ())
    return (
        Exposure(view, train.sequence, "A", window_a, _collect(pulses, window_a), shape, bits),
        Exposure(view, train.sequence, "B", window_b, _collect(pulses, window_b), shape, bits),
    )


def _collect(pulses: tuple[LightPulse, ...], window: Window) -> tuple[CollectedPulse, ...]:
    spans = ((pulse, Window(pulse.start_ns, pulse.start_ns + pulse.width_ns).overlap_ns(window)) for pulse in pulses)
    return tuple(CollectedPulse(pulse.start_ns, span_ns, pulse.current_a) for pulse, span_ns in spans if span_ns)
