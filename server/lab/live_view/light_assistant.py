"""The assistant that sets LED currents so that the background has half of the range, as in the paper. Pure.

It goes by what shots say of themselves: the current that was fired, and the light that came. From one shot it takes
light for proportional to current; from two it knows whether that is so. It never proposes more than the LED's limit.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from daq.run.shots.shot_check import LIT_FRACTION_OF_SCALE
from daq.shot import Shot
from server.lab.live_view.live_feed import exposures_of
from server.pictures.exposure_figures import HALF_RANGE_PERCENT, exposure_figures

NEAR_PERCENT = 3.0
"""So near to half of the range is near enough."""
SATURATED_PERCENT = 0.1
"""With so many pixels at full scale the light is brighter than can be told."""
_FULL_PERCENT = 98.0
_DARK_PERCENT = 100 * LIT_FRACTION_OF_SCALE
_PROPORTIONAL = 0.1
"""Light may differ by so much of itself from what was expected before it counts as not proportional."""
_ANOTHER_CURRENT = 0.05
"""Currents that differ by less than this share tell nothing about proportion."""


@dataclass(frozen=True)
class SeenLight:
    """Light of one view in one shot.

    Parameters
    ----------
    current_a : float
        Peak current that was fired; 0 where there was none.
    light_percent, saturated_percent : float
        Of the brighter exposure, see ``ExposureFigures``.
    """

    current_a: float
    light_percent: float
    saturated_percent: float = 0.0

    @property
    def is_saturated(self) -> bool:
        """It is brighter than can be told."""
        return self.saturated_percent >= SATURATED_PERCENT or self.light_percent >= _FULL_PERCENT

    @property
    def is_dark(self) -> bool:
        """Nobody knows whether that is light or the dark level of the sensor."""
        return self.light_percent < _DARK_PERCENT


@dataclass(frozen=True)
class Advice:
    """What to set one LED to.

    Parameters
    ----------
    current_a : float | None
        The current; None: leave it as it is.
    text : str
        What was done, and why.
    """

    current_a: float | None
    text: str


def seen_light(shot: Shot, bits: Mapping[str, int]) -> dict[str, SeenLight]:
    """Light of every view of a shot that has an exposure; the brighter one of two counts, so that none saturates."""
    seen = {}
    for view, frames in shot.views.items():
        pulses = () if shot.fired is None else shot.fired.pulses.get(view, ())
        figures = [exposure_figures(image, bits[view]) for image in exposures_of(frames).values() if image is not None]
        if figures:
            brightest = max(figures, key=lambda one: (one.saturated_percent, one.light_percent))
            current_a = max((pulse.current_a for pulse in pulses), default=0.0)
            seen[view] = SeenLight(current_a, brightest.light_percent, brightest.saturated_percent)
    return seen


def advise(seen: Sequence[SeenLight], limit_a: float) -> Advice:
    """The current with which a view should have half of its range.

    Parameters
    ----------
    seen : sequence of SeenLight
        What was seen of it, the newest last; at least one.
    limit_a : float
        Of its LED; no advice exceeds it.
    """
    now = seen[-1]
    found = f"{now.light_percent:.0f} % at {now.current_a:g} A"
    if now.current_a <= 0:
        return Advice(None, "no pulse was fired: set a current, and look again")
    if now.is_saturated:
        return _set(now.current_a / 2, limit_a, f"{found}, saturated: halved, look again")
    if now.is_dark:
        return _more_or_why(now, limit_a, found)
    if abs(now.light_percent - HALF_RANGE_PERCENT) <= NEAR_PERCENT:
        return Advice(None, f"{found}: left as it is, half of the range is reached")
    before = _comparable(seen)
    if before is None or _is_proportional(before, now):
        return _set(now.current_a * HALF_RANGE_PERCENT / now.light_percent, limit_a, found, now)
    return _by_line(before, now, limit_a, found)


def _more_or_why(now: SeenLight, limit_a: float, found: str) -> Advice:
    if now.current_a >= limit_a:
        why = "is the lens covered, the aperture closed, the LED plugged in?"
        return Advice(None, f"{found}, the limit: no light to be seen; {why}")
    return _set(2 * now.current_a, limit_a, f"{found}, hardly any light: doubled, look again")


def _by_line(before: SeenLight, now: SeenLight, limit_a: float, found: str) -> Advice:
    """By the line through both: a dark level, or the light of the room, is in what was seen."""
    slope = (now.light_percent - before.light_percent) / (now.current_a - before.current_a)
    told = f"{found}, {before.light_percent:.0f} % at {before.current_a:g} A: not proportional"
    if slope <= 0:
        return Advice(
            None, f"{told}, more current gives no more light; is it the light of this LED, and not saturated?"
        )
    return _set(now.current_a + (HALF_RANGE_PERCENT - now.light_percent) / slope, limit_a, f"{told}, by the line")


def _set(current_a: float, limit_a: float, found: str, now: SeenLight | None = None) -> Advice:
    """Advise a current, in steps of 10 mA, never above the limit."""
    possible_a = math.floor(100 * min(max(current_a, 0.0), limit_a) + 1e-9) / 100
    if current_a <= limit_a:
        return Advice(possible_a, f"{found}: set to {possible_a:g} A")
    reached = "" if now is None else f", about {now.light_percent * possible_a / now.current_a:.0f} %"
    return Advice(possible_a, f"{found}: set to {possible_a:g} A, its limit{reached}; for more light open the aperture")


def _comparable(seen: Sequence[SeenLight]) -> SeenLight | None:
    """The latest shot before, at another current, of which the light is known."""
    now = seen[-1]
    return next(
        (
            one
            for one in reversed(seen[:-1])
            if not (one.is_saturated or one.is_dark)
            and abs(one.current_a - now.current_a) > _ANOTHER_CURRENT * now.current_a
        ),
        None,
    )


def _is_proportional(before: SeenLight, now: SeenLight) -> bool:
    expected = before.light_percent * now.current_a / before.current_a
    return abs(now.light_percent - expected) <= _PROPORTIONAL * expected
