"""Is the pulse train that the generator reports the one that was asked for? Pure."""

from collections.abc import Mapping

from daq.shot import FiredTrain, LightPulse
from daq.timing import ShotTiming

TOLERANCE_NS = 16
"""Two edges, each rounded to the 8 ns grid of the pulse generator."""
CURRENT_TOLERANCE_A = 0.25
"""Resolution and reading error of the current set-point."""


def train_deviation(timing: ShotTiming, train: FiredTrain) -> str | None:
    """First edge, width or current that differs from the request; None if there is none.

    The request counts from light pulse A, the train from its trigger: edges are compared relative to the
    camera trigger of the first view.
    """
    view = next(iter(timing.views))
    if set(train.camera_trigger_ns) != set(timing.views):
        return f"camera triggers of {sorted(train.camera_trigger_ns)} instead of {sorted(timing.views)}"
    origin_ns = train.camera_trigger_ns[view] - timing.views[view].camera_trigger_ns
    asked, found = _edges_ns(timing), _reported_edges_ns(train, origin_ns)
    if missing := sorted(set(asked) ^ set(found)):
        return f"{missing[0]} is {'missing' if missing[0] in asked else 'not asked for'}"
    for name, edge_ns in asked.items():
        if abs(found[name] - edge_ns) > TOLERANCE_NS:
            return f"{name} is {found[name]} ns instead of {edge_ns} ns"
    return _current_deviation(timing, train.pulses)


def _edges_ns(timing: ShotTiming) -> dict[str, int]:
    edges = {}
    for view, one in timing.views.items():
        edges[f"camera trigger of {view}"] = one.camera_trigger_ns
        if one.current_a > 0:
            for number, pulse in enumerate((one.pulse_a, one.pulse_b)):
                edges[f"start of pulse {number} of {view}"] = pulse.open_ns
                edges[f"width of pulse {number} of {view}"] = pulse.close_ns - pulse.open_ns
    return edges


def _reported_edges_ns(train: FiredTrain, origin_ns: int) -> dict[str, int]:
    edges = {f"camera trigger of {view}": edge - origin_ns for view, edge in train.camera_trigger_ns.items()}
    for view, pulses in train.pulses.items():
        for number, pulse in enumerate(lit_pulses(pulses)):
            edges[f"start of pulse {number} of {view}"] = pulse.start_ns - origin_ns
            edges[f"width of pulse {number} of {view}"] = pulse.width_ns
    return edges


def _current_deviation(timing: ShotTiming, pulses: Mapping[str, tuple[LightPulse, ...]]) -> str | None:
    for view, one in timing.views.items():
        for pulse in lit_pulses(pulses.get(view, ())):
            if abs(pulse.current_a - one.current_a) > CURRENT_TOLERANCE_A:
                return f"current of {view} is {pulse.current_a:g} A instead of {one.current_a:g} A"
    return None


def lit_pulses(pulses: tuple[LightPulse, ...]) -> tuple[LightPulse, ...]:
    """Those pulses of a train that carry light."""
    return tuple(pulse for pulse in pulses if pulse.current_a > 0)
