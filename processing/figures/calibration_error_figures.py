"""Figure of true errors of calibrations: view by view and case by case, each kind beside its limit."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter

from processing.figures.colours import VIEW_COLOURS

LINE_LENGTH = 16
"""Letters of a tick label that still fit on one line."""


class ErrorRow(Protocol):
    """What is drawn of one case of one view; a figure that is None is left out."""

    @property
    def case(self) -> str:
        """What was measured under which conditions."""

    @property
    def view(self) -> str:
        """Name of the view."""

    @property
    def value(self) -> float | None:
        """Root mean square, or time."""

    @property
    def maximum(self) -> float | None:
        """Largest error."""

    @property
    def ideal_rms(self) -> float | None:
        """Root mean square of the best unbiased fit."""

    @property
    def ideal_maximum(self) -> float | None:
        """Largest error of the best unbiased fit."""

    @property
    def limit(self) -> float:
        """What must not be exceeded."""


@dataclass(frozen=True)
class ErrorPanel:
    """One panel of the figure.

    Parameters
    ----------
    title : str
        What was measured, and its unit.
    limited : str
        Which of the figures the limit is for.
    rows : sequence of ErrorRow
        All cases of all views; they share a limit.
    """

    title: str
    limited: str
    rows: Sequence[ErrorRow]


def calibration_errors_figure(panels: Sequence[ErrorPanel]) -> Figure:
    """Every case of five kinds of errors, view by view, and the limits."""
    figure = Figure(figsize=(15, 7.4), layout="constrained")
    *all_axes, rest = figure.subplots(2, 3).flat
    for axes, panel in zip(all_axes, panels, strict=True):
        _draw_panel(axes, panel)
        axes.set_title(panel.title, fontsize="medium", loc="left")
    views = list(dict.fromkeys(row.view for panel in panels for row in panel.rows))
    handles = [
        *(_mark(colour, "s", colour, view) for view, colour in zip(views, VIEW_COLOURS, strict=False)),
        _mark("0.2", "o", "0.2", "rms, or time"),
        _mark("0.2", "^", "white", "largest error"),
        _mark("0.2", "_", "0.2", "both of the best unbiased fit"),
    ]
    rest.set_axis_off()
    rest.legend(handles=handles, frameon=False, loc="center")
    return figure


def _mark(colour: str, marker: str, inside: str, label: str) -> Line2D:
    return Line2D([], [], color=colour, marker=marker, markerfacecolor=inside, linestyle="none", label=label)


def _draw_panel(axes: Axes, panel: ErrorPanel) -> None:
    axes.set_yscale("log")
    cases = list(dict.fromkeys(row.case for row in panel.rows))
    views = list(dict.fromkeys(row.view for row in panel.rows))
    for row in panel.rows:
        number = views.index(row.view)
        place, colour = cases.index(row.case) + 0.16 * (number - 1.5), VIEW_COLOURS[number % len(VIEW_COLOURS)]
        _draw_points(axes, place, row, colour)
    if panel.rows:
        _draw_limit(axes, panel, len(cases))
    axes.set_xticks(range(len(cases)), [_two_lines(case) for case in cases], fontsize=8)
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.grid(alpha=0.25, axis="y")


def _draw_points(axes: Axes, place: float, row: ErrorRow, colour: str) -> None:
    """Rms filled, largest error open, and what the best fit has of both."""
    for value, inside, marker in ((row.value, colour, "o"), (row.maximum, "white", "^")):
        if value is not None:
            axes.plot(place, value, marker=marker, color=colour, markerfacecolor=inside, markersize=5)
    for value in (row.ideal_rms, row.ideal_maximum):
        if value is not None:
            axes.plot(place, value, marker="_", color="0.2", markersize=11)


def _draw_limit(axes: Axes, panel: ErrorPanel, n_cases: int) -> None:
    limit = panel.rows[0].limit
    shown = [limit, *(value for row in panel.rows for value in _values(row))]
    axes.set(xlim=(-0.5, n_cases - 0.5), ylim=(0.6 * min(shown), 1.7 * max(shown)))
    axes.axhline(limit, color="0.4", linestyle="--", linewidth=1)
    words, place = f"limit of the {panel.limited}", (0.01, limit)
    axes.annotate(words, place, xycoords=("axes fraction", "data"), va="bottom", color="0.3", fontsize=8)


def _values(row: ErrorRow) -> list[float]:
    shown = (row.value, row.maximum, row.ideal_rms, row.ideal_maximum)
    return [value for value in shown if value is not None]


def _two_lines(case: str) -> str:
    """The words of a case, a long one broken after its first part or in the middle, so that ticks stay apart."""
    text = case.replace("pinhole_tilted", "tilted").replace("mm3", "mm³")
    what, comma, where = text.partition(", ")
    if len(text) <= LINE_LENGTH:
        return text
    if comma and len(what) > 5:
        return f"{what},\n{where}"
    words = text.split()
    half = (len(words) + 1) // 2
    return "\n".join((" ".join(words[:half]), " ".join(words[half:])))
