"""Figures of measured droplets: how many were found, and how many are ghosts, against what is asked for."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure


@dataclass(frozen=True)
class MeasuredCase:
    """Shares of the shots of a case, 0 to 1.

    Parameters
    ----------
    found, ghosts : sequence of float
        One per shot.
    least_found, most_ghosts : float | None
        What is asked for.
    """

    found: Sequence[float]
    ghosts: Sequence[float]
    least_found: float | None = None
    most_ghosts: float | None = None


def droplets_figure(cases: Mapping[str, MeasuredCase]) -> Figure:
    """Found droplets and ghosts of every shot of every case, means, and limits as lines."""
    figure = Figure(figsize=(10, 1.6 + 0.5 * len(cases)), layout="constrained")
    found_axes, ghost_axes = figure.subplots(1, 2, sharey=True)
    for line, case in enumerate(cases.values()):
        draw_case(found_axes, line, case.found, case.least_found, 100)
        draw_case(ghost_axes, line, case.ghosts, case.most_ghosts, 100)
    found_axes.set(xlabel="found [% of the droplets]", yticks=range(len(cases)), yticklabels=list(cases))
    ghost_axes.set(xlabel="ghosts [% of what was found]")
    found_axes.invert_yaxis()
    figure.suptitle("each shot a dot, their mean a bar, what is asked for a red line", fontsize="small")
    return figure


def draw_case(axes: Axes, line: int, values: Sequence[float], limit: float | None, scale: float = 1) -> None:
    """A line of a study's figure: a dot per shot, a bar at their mean, and what is asked for in red."""
    drawn = scale * np.asarray(values)
    axes.plot(drawn, np.full(len(drawn), line), marker="o", linestyle="none", color="0.4", alpha=0.6)
    axes.plot([drawn.mean()] * 2, [line - 0.25, line + 0.25], color="0.1", linewidth=2)
    if limit is not None:
        axes.plot([scale * limit] * 2, [line - 0.4, line + 0.4], color="tab:red", linewidth=1)
    axes.grid(alpha=0.25, axis="x")
