"""Timing diagram of a shot: camera triggers, exposures and light pulses of all views.

Exposures last up to many milliseconds, pulses a microsecond: a strip on top shows the whole shot, the panel below the
surroundings of the frame boundary to scale, with all distances in ns.
"""

from collections.abc import Sequence
from io import BytesIO
from threading import Lock
from typing import Any, Literal

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from daq.timing import ShotTiming, ViewTiming, Window
from processing.figures.colours import FRAME_COLOURS
from server.rig.shot_timing import guards_of

_DRAWING = Lock()
"""Settings and fonts of matplotlib belong to the process; the server draws in several threads."""
_LIGHT = "#f2a900"
_INK = "0.15"
_SMALL = 8
_LANE = 0.62
_ROWS = {"trigger": 2, "frames": 1, "light": 0}
_ROWS_PER_VIEW = 3.6
_ROOM_FOR_TEXT = 0.05
_FIGURE_WIDTH_IN = 11.0


def timing_diagram(timing: ShotTiming, title: str = "") -> Figure:
    """Draw one shot; times count from the start of light pulse A.

    Parameters
    ----------
    timing : ShotTiming
        Edges of all views in ns, as asked for or as fired.
    title : str
        Title of the figure.
    """
    count = len(timing.views)
    figure = Figure(figsize=(_FIGURE_WIDTH_IN, 2.0 + 1.45 * count), layout="constrained")
    heights = (0.55 + 0.16 * count, 1.3 * count)
    overview, boundary = figure.subplots(2, 1, height_ratios=heights)
    zoom = _zoom(timing)
    _draw_overview(overview, timing, zoom)
    _draw_boundary(boundary, timing, zoom)
    if title:
        figure.suptitle(title, fontsize="large")
    return figure


def picture(figure: Figure, kind: Literal["svg", "png"]) -> bytes:
    """Render a figure; the same figure gives the same bytes."""
    target = BytesIO()
    with _DRAWING, rc_context({"svg.hashsalt": "tomoshadow", "svg.fonttype": "none"}):
        figure.savefig(target, format=kind, dpi=130, metadata={"Date": None} if kind == "svg" else None)
    return target.getvalue()


def _zoom(timing: ShotTiming) -> Window:
    """Both pulses of all views with a margin, and the camera triggers where they are not far away."""
    views = list(timing.views.values())
    first_ns = min(view.pulse_a.open_ns for view in views)
    last_ns = max(view.pulse_b.close_ns for view in views)
    span_ns = last_ns - first_ns
    near = [t for view in views for t in (view.camera_trigger_ns, view.frame_a.open_ns) if first_ns - t < 2 * span_ns]
    first_ns = min([first_ns, *near])
    margin_ns = round(0.07 * (last_ns - first_ns))
    return Window(first_ns - 2 * margin_ns, last_ns + 2 * margin_ns)


def _draw_overview(axes: Axes, timing: ShotTiming, zoom: Window) -> None:
    ends_ns = [edge for view in timing.views.values() for edge in (view.camera_trigger_ns, view.frame_b.close_ns)]
    length_ns = max(ends_ns) - min(ends_ns)
    unit, per_unit = ("ms", 1e6) if length_ns > 1_000_000 else ("µs", 1e3)
    for row, view in enumerate(timing.views.values()):
        for window, frame in ((view.frame_a, "A"), (view.frame_b, "B")):
            left, width = window.open_ns / per_unit, (window.close_ns - window.open_ns) / per_unit
            axes.barh(row, width, 0.6, left, color=FRAME_COLOURS[frame], alpha=0.35, linewidth=0)
            if width * per_unit > 0.1 * length_ns:
                text = f"exposure {frame}: {_duration(window.close_ns - window.open_ns)}"
                axes.text(left + width / 2, row, text, ha="center", va="center", fontsize=_SMALL, color=_INK)
    axes.axvspan(zoom.open_ns / per_unit, zoom.close_ns / per_unit, color=_LIGHT, alpha=0.9, linewidth=1)
    axes.annotate(
        "enlarged below",
        (zoom.close_ns / per_unit, 1.0),
        (4, 2),
        xycoords=("data", "axes fraction"),
        textcoords="offset points",
        fontsize=_SMALL,
        color=_INK,
    )
    axes.set(xlabel=f"whole shot [{unit}]", ylim=(len(timing.views) - 0.5, -0.5))
    axes.set_xlim(min(ends_ns) / per_unit - 0.02 * length_ns / per_unit, max(ends_ns) / per_unit)
    axes.set_yticks(range(len(timing.views)), list(timing.views), fontsize=_SMALL)
    _plain(axes)


def _draw_boundary(axes: Axes, timing: ShotTiming, zoom: Window) -> None:
    ticks: list[float] = []
    labels: list[str] = []
    for number, (name, view) in enumerate(reversed(list(timing.views.items()))):
        base = number * _ROWS_PER_VIEW
        _draw_view(axes, view, base, zoom)
        ticks += [base + row for row in _ROWS.values()]
        light = f"light, {view.current_a:g} A" if view.current_a else "no light"
        labels += [f"{name}: camera trigger", "exposures", light]
    axes.set_yticks(ticks, labels, fontsize=_SMALL)
    top = (len(timing.views) - 1) * _ROWS_PER_VIEW + _ROWS["trigger"] + 0.9
    _draw_separation(axes, next(iter(timing.views.values())), top)
    axes.set(xlabel="frame boundary [ns], 0 is the start of light pulse A", ylim=(-0.7, top + 0.9))
    axes.set_xlim(zoom.open_ns, zoom.close_ns)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:,.0f}".replace(",", "\N{NARROW NO-BREAK SPACE}"))
    axes.grid(axis="x", color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    _plain(axes)


def _draw_view(axes: Axes, view: ViewTiming, base: float, zoom: Window) -> None:
    _draw_trigger(axes, view, base + _ROWS["trigger"], zoom)
    frames, light = base + _ROWS["frames"], base + _ROWS["light"]
    for window, name in ((view.frame_a, "A"), (view.frame_b, "B")):
        _draw_frame(axes, window, name, frames, zoom)
    for edge_ns in (view.frame_a.close_ns, view.frame_b.open_ns):
        axes.plot([edge_ns, edge_ns], [light - 0.45, frames], color="0.45", linestyle=":", linewidth=1)
    _distance(axes, view.frame_a.close_ns, view.frame_b.open_ns, frames + 0.5, "gap ")
    style: dict[str, Any] = {"facecolor": _LIGHT} if view.current_a else {"facecolor": "none", "linestyle": "--"}
    for pulse, outside in ((view.pulse_a, "right"), (view.pulse_b, "left")):
        width_ns = pulse.close_ns - pulse.open_ns
        axes.barh(light, width_ns, _LANE, pulse.open_ns, edgecolor=_INK, linewidth=0.8, **style)
        if width_ns > _ROOM_FOR_TEXT * (zoom.close_ns - zoom.open_ns):
            _label(axes, (pulse.open_ns + pulse.close_ns) / 2, light, f"{width_ns} ns")
        else:
            edge_ns = pulse.open_ns if outside == "right" else pulse.close_ns
            _label(axes, edge_ns, light, f" {width_ns} ns ", ha=outside)
    guards = guards_of(view)
    _distance(axes, view.pulse_a.close_ns, view.frame_a.close_ns, light, "", guards.before_ns)
    _distance(axes, view.frame_b.open_ns, view.pulse_b.open_ns, light, "", guards.after_ns)


def _draw_trigger(axes: Axes, view: ViewTiming, row: float, zoom: Window) -> None:
    trigger_ns = view.camera_trigger_ns
    if trigger_ns < zoom.open_ns:
        text = f"◂ rising edge at {_thousands(trigger_ns)} ns"
        axes.annotate(text, (0.005, row), xycoords=("axes fraction", "data"), va="center", fontsize=_SMALL)
        return
    low, high = row - _LANE / 2, row + _LANE / 2
    axes.plot([zoom.open_ns, trigger_ns, trigger_ns, zoom.close_ns], [low, low, high, high], color=_INK, linewidth=1.2)
    axes.annotate(
        f"{_thousands(trigger_ns)} ns", (trigger_ns, row), (4, 0), textcoords="offset points", va="center",
        fontsize=_SMALL,
    )  # fmt: skip


def _draw_frame(axes: Axes, window: Window, name: str, row: float, zoom: Window) -> None:
    left, right = max(window.open_ns, zoom.open_ns), min(window.close_ns, zoom.close_ns)
    axes.barh(row, right - left, _LANE, left, color=FRAME_COLOURS[name], alpha=0.35, linewidth=0)
    text = f"{name}: {_duration(window.close_ns - window.open_ns)}"
    if window.open_ns < zoom.open_ns:
        text = f"◂ opens at {_thousands(window.open_ns)} ns    {text}"
    if window.close_ns > zoom.close_ns:
        text = f"{text} ▸"
    _label(axes, (left + right) / 2, row, text)


def _draw_separation(axes: Axes, view: ViewTiming, row: float) -> None:
    _distance(axes, view.pulse_a.open_ns, view.pulse_b.open_ns, row, "separation ")


def _distance(axes: Axes, from_ns: float, to_ns: float, row: float, what: str, length_ns: float | None = None) -> None:
    """Arrow between two edges with its length above it."""
    axes.annotate(
        "", (to_ns, row), (from_ns, row), arrowprops={"arrowstyle": "<->", "color": _INK, "shrinkA": 0, "shrinkB": 0}
    )
    text = f"{what}{_thousands(to_ns - from_ns if length_ns is None else length_ns)} ns"
    _label(axes, (from_ns + to_ns) / 2, row + 0.08, text, va="bottom")


def _label(axes: Axes, at_ns: float, row: float, text: str, ha: str = "center", va: str = "center") -> None:
    axes.text(at_ns, row, text, ha=ha, va=va, fontsize=_SMALL, color=_INK)


def _thousands(value: float) -> str:
    return f"{value:,.0f}".replace(",", "\N{NARROW NO-BREAK SPACE}").replace("-", "\N{MINUS SIGN}")


def _duration(length_ns: int) -> str:
    for unit, per_unit in (("ms", 1_000_000), ("µs", 1000)):
        if length_ns >= per_unit:
            return f"{length_ns / per_unit:g} {unit}"
    return f"{length_ns} ns"


def _plain(axes: Axes) -> None:
    sides: Sequence[str] = ("top", "right", "left")
    axes.spines[list(sides)].set_visible(False)
    axes.tick_params(axis="y", length=0)
    axes.tick_params(axis="x", labelsize=_SMALL)
