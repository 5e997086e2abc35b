"""What the calibration study says: statements beside the paper's, and a figure of every limit."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from processing.studies.calibration_accuracy import AccuracyRow, of_quantity
from processing.studies.report import Statement

COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7")
TITLES = {
    "true error": "cameras: error in the volume [px]",
    "corner error": "corners: error in the image [px]",
    "corner time": "corners: CPU time per image [s]",
    "drift error": "self-calibration: error left in the volume [px]",
}
PAPER = {
    "true error": "< 0.05 px on the points of the fit; the volume is not asked",
    "corner error": "0.1 px",
    "corner time": "not given",
    "drift error": "no self-calibration",
}


def accuracy_statements(rows: Sequence[AccuracyRow]) -> list[Statement]:
    """The worst view of every case beside the limit and the paper's statement."""
    return [
        Statement(
            f"{quantity}, {case} (limit {_number(chosen[0].limit, quantity)})",
            PAPER[quantity],
            _worst(chosen, quantity),
        )
        for quantity in TITLES
        for case, chosen in _by_case(of_quantity(rows, quantity)).items()
    ]


def accuracy_line(row: AccuracyRow) -> str:
    """One row for a person."""
    return f"{row.quantity}, {row.case}, {row.view}: {_worst([row], row.quantity)}"


def accuracy_figure(rows: Sequence[AccuracyRow]) -> Figure:
    """Every case of every quantity, view by view, and the limits."""
    figure = Figure(figsize=(10, 6.4), layout="constrained")
    for axes, (quantity, title) in zip(figure.subplots(2, 2).flat, TITLES.items(), strict=True):
        _panel(axes, of_quantity(rows, quantity))
        axes.set_title(title, fontsize="medium", loc="left")
    views = list(dict.fromkeys(row.view for row in rows))
    points = [
        Line2D([], [], color=colour, marker="o", label=view) for view, colour in zip(views, COLOURS, strict=False)
    ]
    figure.legend(handles=points, frameon=False, ncols=4, loc="outside lower center", title="rms to largest error")
    return figure


def _panel(axes: Axes, rows: Sequence[AccuracyRow]) -> None:
    axes.set_yscale("log")
    cases, views = list(_by_case(rows)), list(dict.fromkeys(row.view for row in rows))
    for row in rows:
        number = views.index(row.view)
        place, colour = cases.index(row.case) + 0.12 * (number - 1.5), COLOURS[number % len(COLOURS)]
        reach = [value for value in (row.value, row.maximum) if value is not None]
        axes.plot([place] * len(reach), reach, "-o", color=colour, linewidth=1, markevery=[0] if reach else None)
    if rows:
        axes.set_xlim(-0.5, len(cases) - 0.5)
        axes.set_ylim(top=2 * max(rows[0].limit, *(row.maximum or 0 for row in rows)))
        axes.axhline(rows[0].limit, color="0.4", linestyle="--", linewidth=1)
        axes.annotate("limit", (0.01, rows[0].limit), xycoords=("axes fraction", "data"), va="bottom", color="0.4")
    axes.set_xticks(range(len(cases)), [case.replace(" and ", "\nand ").replace(" ", "\n", 1) for case in cases])
    axes.tick_params(axis="x", labelsize="small")
    axes.grid(alpha=0.25, axis="y")


def _by_case(rows: Sequence[AccuracyRow]) -> dict[str, list[AccuracyRow]]:
    cases: dict[str, list[AccuracyRow]] = {}
    for row in rows:
        cases.setdefault(row.case, []).append(row)
    return cases


def _worst(rows: Sequence[AccuracyRow], quantity: str) -> str:
    values = [row.value for row in rows if row.value is not None]
    if len(values) < len(rows):
        return f"refused in {len(rows) - len(values)} of {len(rows)} views"
    text = _number(max(values), quantity)
    largest = [row.maximum for row in rows if row.maximum is not None]
    if largest:
        text = f"{text} rms, {max(largest):.2g} px at most"
    return text if all(row.kept for row in rows) else f"{text}: BEYOND THE LIMIT"


def _number(value: float, quantity: str) -> str:
    return f"{value:.2g} {'s' if quantity == 'corner time' else 'px'}"
