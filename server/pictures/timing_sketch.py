"""Timing of a shot as a small SVG for the page: where the pulses lie in the exposures around the frame boundary. Pure.

It takes the colour of the text around it, and a millisecond to draw; ``timing_diagram`` has all edges of a shot.
"""

from collections.abc import Iterator

from daq.timing import ShotTiming, ViewTiming, Window
from processing.figures.colours import FRAME_COLOURS
from server.rig.shot_timing import guards_of

_LIGHT = "#f2a900"
_WIDTH, _LEFT, _ROW, _HEAD, _FOOT = 330.0, 44.0, 38.0, 34.0, 24.0
_TEXT = 'font-size="10" fill="currentColor"'


def timing_sketch(timing: ShotTiming) -> str:
    """SVG of the frame boundary of every view; times count from the start of light pulse A."""
    sketch = _Sketch(_span(timing))
    height = _HEAD + _ROW * len(timing.views) + _FOOT
    parts = [*sketch.head(next(iter(timing.views.values())))]
    for number, (name, view) in enumerate(timing.views.items()):
        parts += sketch.row(name, view, _HEAD + _ROW * number)
    parts += sketch.axis(height - _FOOT)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH:g} {height:g}" width="100%" role="img" '
        f'aria-label="timing of a shot" font-family="system-ui, sans-serif">{"".join(parts)}</svg>'
    )


class _Sketch:
    """Draws in a span of time."""

    def __init__(self, span: Window) -> None:
        self._span = span
        self._px_per_ns = (_WIDTH - _LEFT - 6) / (span.close_ns - span.open_ns)

    def head(self, view: ViewTiming) -> Iterator[str]:
        """The separation, and how long a pulse is."""
        left, right = self._x(view.pulse_a.open_ns), self._x(view.pulse_b.open_ns)
        yield f'<path d="M{left:.1f} 22V28M{left:.1f} 25H{right:.1f}M{right:.1f} 22V28" stroke="currentColor"/>'
        width_ns = view.pulse_a.close_ns - view.pulse_a.open_ns
        separation_ns = view.pulse_b.open_ns - view.pulse_a.open_ns
        yield _text(_LEFT, 12, f"separation {_told(separation_ns)}, pulses {_told(width_ns)}")

    def row(self, name: str, view: ViewTiming, top: float) -> Iterator[str]:
        """Exposures, pulses, and how far they are from the gap."""
        yield _text(0, top + 16, name)
        for window, frame in ((view.frame_a, "A"), (view.frame_b, "B")):
            yield self._bar(window, top + 4, 18, FRAME_COLOURS[frame], 0.4)
            end, anchor = (window.open_ns, "start") if frame == "A" else (window.close_ns, "end")
            yield _text(self._x(end) + (4 if frame == "A" else -4), top + 17, frame, anchor)
        for pulse in (view.pulse_a, view.pulse_b):
            if view.current_a:
                yield self._bar(pulse, top + 8, 10, _LIGHT, 1.0)
        guards = guards_of(view)
        gap_ns = view.frame_b.open_ns - view.frame_a.close_ns
        light = f"{view.current_a:g} A" if view.current_a else "no light"
        before, after = _told(guards.before_ns), _told(guards.after_ns)
        told = f"{light}; {before} before and {after} after the gap of {_told(gap_ns)}"
        yield f'<text x="{_LEFT:g}" y="{top + 33:.1f}" font-size="9" fill="currentColor" opacity=".75">{told}</text>'

    def axis(self, top: float) -> Iterator[str]:
        """Ticks of a round number of nanoseconds."""
        yield f'<path d="M{_LEFT:g} {top + 4:.1f}H{_WIDTH - 6:g}" stroke="currentColor" opacity=".5"/>'
        step_ns = _round_step((self._span.close_ns - self._span.open_ns) / 5)
        for tick_ns in range(-(-self._span.open_ns // step_ns) * step_ns, self._span.close_ns, step_ns):
            x = self._x(tick_ns)
            yield f'<path d="M{x:.1f} {top + 4:.1f}v4" stroke="currentColor" opacity=".5"/>'
            yield _text(x, top + 19, f"{tick_ns / 1000:g}", "middle")
        yield _text(0, top + 19, "µs")

    def _bar(self, window: Window, top: float, height: float, colour: str, opacity: float) -> str:
        left, right = self._x(window.open_ns), self._x(window.close_ns)
        size = f'width="{max(right - left, 1):.1f}" height="{height:g}"'
        return f'<rect x="{left:.1f}" y="{top:.1f}" {size} fill="{colour}" fill-opacity="{opacity:g}"/>'

    def _x(self, time_ns: int) -> float:
        within_ns = min(max(time_ns, self._span.open_ns), self._span.close_ns)
        return _LEFT + (within_ns - self._span.open_ns) * self._px_per_ns


def _span(timing: ShotTiming) -> Window:
    """Both pulses of all views with a margin."""
    views = timing.views.values()
    first_ns = min(view.pulse_a.open_ns for view in views)
    last_ns = max(view.pulse_b.close_ns for view in views)
    margin_ns = max(1, round(0.15 * (last_ns - first_ns)))
    return Window(first_ns - margin_ns, last_ns + margin_ns)


def _round_step(step_ns: float) -> int:
    """The nearest of 1, 2 and 5 with any number of zeros, from below."""
    power = 1
    while 10 * power <= step_ns:
        power *= 10
    return max(factor * power for factor in (1, 2, 5) if factor * power <= max(step_ns, 1))


def _told(time_ns: int) -> str:
    return f"{time_ns} ns" if abs(time_ns) < 10_000 else f"{time_ns / 1000:g} µs"


def _text(x: float, y: float, text: str, anchor: str = "start") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" {_TEXT}>{text}</text>'
