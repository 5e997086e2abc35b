"""What the calibration study says: statements beside limits and the paper's, and a figure of every limit."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter

from processing.figures.colours import VIEW_COLOURS
from processing.studies.accuracy_study import AccuracyRow, of_quantity
from processing.studies.report import Statement

TITLES = {
    "true error": "cameras: error in space [px]",
    "corner error": "corners: error in the image [px]",
    "corner time": "corners: CPU time per image [s]",
    "disparity error": "watch: error of the disparity of single shots [px]",
    "drift error": "self-calibration: error left in the volume [px]",
}
LIMITED = {
    "true error": "rms",
    "corner error": "rms",
    "corner time": "time",
    "disparity error": "rms and alarms",
    "drift error": "largest error",
}
"""Which of its figures a quantity's limit is for."""
LINE_LENGTH = 16
"""Letters of a tick label that still fit on one line."""
PAPER = {
    "true error": "< 0.05 px on the points of the fit; the volume is not asked",
    "corner error": "0.1 px",
    "corner time": "not given",
    "disparity error": "no watch",
    "drift error": "no self-calibration",
}


def accuracy_statements(rows: Sequence[AccuracyRow]) -> list[Statement]:
    """The worst view of every case beside the limit and the paper's statement; then all fits beside the best ones."""
    statements = [
        Statement(
            f"{quantity}, {case} (limit {_number(chosen[0].limit, quantity)})",
            PAPER[quantity],
            _worst(chosen, quantity),
        )
        for quantity in TITLES
        for case, chosen in _by_case(of_quantity(rows, quantity)).items()
    ]
    ratio = over_ideal(rows)
    if ratio is None:
        return statements
    topic = "rms of all fits, relative to that of the best unbiased fits"
    return [*statements, Statement(topic, "not given", f"{ratio:.2f}")]


def over_ideal(rows: Sequence[AccuracyRow]) -> float | None:
    """Root mean square of all true errors over that of the best unbiased fits; None without such rows."""
    pairs = [(row.value, row.ideal_rms) for row in rows if row.value is not None and row.ideal_rms is not None]
    if not pairs:
        return None
    found, ideal = np.square(pairs).sum(axis=0)
    return float(np.sqrt(found / ideal))


def all_kept(rows: Sequence[AccuracyRow]) -> bool:
    """Whether every limit is kept in every view."""
    return all(row.kept for row in rows)


def accuracy_line(row: AccuracyRow) -> str:
    """One row for a person."""
    return f"{row.quantity}, {row.case}, {row.view}: {_worst([row], row.quantity)}"


def accuracy_figure(rows: Sequence[AccuracyRow]) -> Figure:
    """Every case of every quantity, view by view, and the limits."""
    figure = Figure(figsize=(15, 7.4), layout="constrained")
    *panels, rest = figure.subplots(2, 3).flat
    for axes, (quantity, title) in zip(panels, TITLES.items(), strict=True):
        _panel(axes, of_quantity(rows, quantity))
        axes.set_title(title, fontsize="medium", loc="left")
    views = list(dict.fromkeys(row.view for row in rows))
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


def _panel(axes: Axes, rows: Sequence[AccuracyRow]) -> None:
    axes.set_yscale("log")
    cases, views = list(_by_case(rows)), list(dict.fromkeys(row.view for row in rows))
    for row in rows:
        number = views.index(row.view)
        place, colour = cases.index(row.case) + 0.16 * (number - 1.5), VIEW_COLOURS[number % len(VIEW_COLOURS)]
        _points(axes, place, row, colour)
    if rows:
        limit = rows[0].limit
        shown = [value for row in rows for value in _values(row)]
        axes.set(xlim=(-0.5, len(cases) - 0.5), ylim=(0.6 * min([limit, *shown]), 1.7 * max([limit, *shown])))
        axes.axhline(limit, color="0.4", linestyle="--", linewidth=1)
        words = f"limit of the {LIMITED[rows[0].quantity]}"
        axes.annotate(words, (0.01, limit), xycoords=("axes fraction", "data"), va="bottom", color="0.3", fontsize=8)
    axes.set_xticks(range(len(cases)), [_two_lines(case) for case in cases], fontsize=8)
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.grid(alpha=0.25, axis="y")


def _points(axes: Axes, place: float, row: AccuracyRow, colour: str) -> None:
    """Rms filled, largest error open, and what the best fit has of both."""
    for value, inside, marker in ((row.value, colour, "o"), (row.maximum, "white", "^")):
        if value is not None:
            axes.plot(place, value, marker=marker, color=colour, markerfacecolor=inside, markersize=5)
    for value in (row.ideal_rms, row.ideal_maximum):
        if value is not None:
            axes.plot(place, value, marker="_", color="0.2", markersize=11)


def _values(row: AccuracyRow) -> list[float]:
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


def _by_case(rows: Sequence[AccuracyRow]) -> dict[str, list[AccuracyRow]]:
    cases: dict[str, list[AccuracyRow]] = {}
    for row in rows:
        cases.setdefault(row.case, []).append(row)
    return cases


def _worst(rows: Sequence[AccuracyRow], quantity: str) -> str:
    verdict = f"{LIMITED[quantity]} {'within' if all_kept(rows) else 'BEYOND'} the limit"
    values = _known(rows, "value")
    if len(values) < len(rows):
        return f"refused in {len(rows) - len(values)} of {len(rows)} views: {verdict}"
    text = _number(max(values), quantity)
    largest = _known(rows, "maximum")
    if largest:
        text = f"{text} rms, {max(largest):.2g} px at most"
    return f"{text}{_beside_the_ideal(rows)}: {verdict}"


def _beside_the_ideal(rows: Sequence[AccuracyRow]) -> str:
    """How much of it lies within the limit, and what the best fits leave; nothing where nobody asked."""
    if any(row.ideal_rms is None for row in rows):
        return ""
    rms_px, largest_px = (max(_known(rows, name)) for name in ("ideal_rms", "ideal_maximum"))
    within, fits_within = (100 * min(_known(rows, name)) for name in ("within", "ideal_fits_within"))
    limit = f"within {rows[0].limit:g} px"
    return (
        f", {within:.1f} % {limit} (best unbiased fits: {rms_px:.2g} px rms, {largest_px:.2g} px at most, "
        f"{fits_within:.0f} % of the fits {limit} everywhere)"
    )


def _known(rows: Sequence[AccuracyRow], name: str) -> list[float]:
    return [value for row in rows if (value := getattr(row, name)) is not None]


def _number(value: float, quantity: str) -> str:
    return f"{value:.2g} {'s' if quantity == 'corner time' else 'px'}"
