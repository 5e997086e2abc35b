"""Time from exposure A to B of a shot: as the pulses were fired, else as the run states it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from daq.files.run_directory import LightPulse, RunReader, Shot

NOT_DOUBLE = "shots have one exposure: a velocity needs two"
UNKNOWN = (
    "nobody knows the time from exposure A to B: the run has neither fired pulses nor a separation (separation_ns of "
    "the manifest)"
)


@dataclass(frozen=True)
class Separation:
    """Time from A to B.

    Parameters
    ----------
    mean_ns : float
        From the middle of a pulse to that of the next, mean of the views.
    spread_ns : float
        Between the view with the longest and that with the shortest.
    source : str
        ``fired``: the pulses as they were fired; ``stated``: the run's header, the same for all shots.
    """

    mean_ns: float
    spread_ns: float
    source: Literal["fired", "stated"]


def separation_of(run: RunReader, shot: Shot) -> Separation | str:
    """Separation of a shot, or why there is none.

    Every view has its own light, so each has its own pulses; views that were not lit have no say. A copy of A that is
    called B was taken at no other time.
    """
    if run.header.frames_per_shot == 1:
        return NOT_DOUBLE
    separation = _told(run, shot)
    if isinstance(separation, Separation) and (copied := _copied(shot)):
        return f"exposure B of {', '.join(copied)} has the very pixels of A: one image is there twice"
    return separation


def _told(run: RunReader, shot: Shot) -> Separation | str:
    """As fired, else as stated."""
    trains = [pulses for pulses in shot.fired.pulses.values() if pulses] if shot.fired else []
    if not trains:
        stated_ns = run.header.separation_ns
        return _separation([float(stated_ns)], "stated") if stated_ns else UNKNOWN
    if odd := {len(pulses) for pulses in trains if len(pulses) != 2}:
        return f"views were lit {', '.join(map(str, sorted(odd)))} times: which pulse is in which exposure is not known"
    fired_ns = [_middle_ns(second) - _middle_ns(first) for first, second in trains]
    return _separation(fired_ns, "fired")


def _copied(shot: Shot) -> list[str]:
    """Views whose two exposures are one image, which noise never makes; flat ones may well be alike."""
    return [
        name
        for name, seen in shot.views.items()
        if seen.frame_b is not None and np.ptp(seen.frame_a) and np.array_equal(seen.frame_a, seen.frame_b)
    ]


def _separation(by_view_ns: Sequence[float], source: Literal["fired", "stated"]) -> Separation | str:
    if (least_ns := min(by_view_ns)) <= 0:
        span = " to ".join(f"{one_ns:g}" for one_ns in dict.fromkeys((least_ns, max(by_view_ns))))
        return f"B comes {span} ns after A, as {source}: exposures or pulses are exchanged"
    return Separation(float(np.mean(by_view_ns)), float(np.ptp(by_view_ns)), source)


def _middle_ns(pulse: LightPulse) -> float:
    return pulse.start_ns + pulse.width_ns / 2
