"""How often intervals hold the truth, case by case, against what is asked for."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

MARKERS = {"D32": ("o", "#0072b2"), "Dv0.5": ("s", "#009e73"), "span": ("^", "#d55e00"), "mass flux": ("D", "#cc79a7")}


def coverage_figure(cases: Mapping[str, Mapping[str, float | None]], asked_for: tuple[float, float]) -> Figure:
    """Shares that hold the truth, a line per case, a marker per figure; the band is what is asked for.

    Parameters
    ----------
    cases : mapping of case to mapping of figure to float
        0 to 1; None where no interval is told.
    asked_for : tuple of two float
        Least and most.
    """
    figure = Figure(figsize=(9, 1.5 + 0.38 * len(cases)), layout="constrained")
    axes = figure.add_subplot()
    axes.axvspan(100 * asked_for[0], 100 * asked_for[1], color="0.9", lw=0)
    for name, (marker, colour) in MARKERS.items():
        shares = [np.nan if (share := shown[name]) is None else 100 * share for shown in cases.values()]
        axes.plot(shares, range(len(cases)), marker=marker, ls="none", color=colour, label=name)
    axes.set(xlabel="90 % intervals that hold the truth [%]", yticks=range(len(cases)), yticklabels=list(cases))
    axes.invert_yaxis()
    axes.grid(alpha=0.25, axis="x")
    axes.legend(fontsize="small", loc="upper left")
    return figure
