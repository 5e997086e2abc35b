"""Distributions of diameters by number, area and volume, fits, and the cumulative curves."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from processing.analysis.spray.spray_statistics import SprayStatistics

MARKED = {"d10_um": ("D10", "#d55e00"), "d32_um": ("D32", "#0072b2"), "dv50_um": ("Dv0.5", "#009e73")}
FIT_LINES = {"lognormal": ("-", "#cc79a7"), "rosin-rammler": ("--", "#444444")}


def distribution_figure(told: SprayStatistics) -> Figure:
    """Histograms over ln d on the classes of ISO 9276-1, fits and mean diameters; beside them the cumulative curves.

    Parameters
    ----------
    told : SprayStatistics
        With classes.
    """
    figure = Figure(figsize=(9.5, 4.2), layout="constrained")
    densities, cumulative = figure.subplots(1, 2)
    _draw_densities(densities, told)
    _draw_cumulative(cumulative, told)
    for axes in (densities, cumulative):
        axes.set(xscale="log", xlabel="diameter d [µm]", ylim=(0, None))
        axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.grid(alpha=0.25)
        axes.legend(fontsize="x-small")
    return figure


def _edges_um(told: SprayStatistics) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return np.array([*(one.low_um for one in told.classes), told.classes[-1].high_um])


def _draw_densities(axes: Axes, told: SprayStatistics) -> None:
    """Densities per ln d, so that areas on the logarithmic axis are shares."""
    edges_um = _edges_um(told)
    middles_um = np.sqrt(edges_um[:-1] * edges_um[1:])
    by_log = np.diff(edges_um) / np.diff(np.log(edges_um))
    number = by_log * np.array([[one.q0_per_um.value, one.q0_per_um.low, one.q0_per_um.high] for one in told.classes]).T
    axes.stairs(number[0], edges_um, fill=True, color="0.8", label="by number")
    axes.errorbar(middles_um, number[0], [number[0] - number[1], number[2] - number[0]], fmt="none", ecolor="0.5", lw=1)
    axes.stairs(by_log * [one.q2_per_um for one in told.classes], edges_um, color="#e69f00", label="by area")
    axes.stairs(by_log * [one.q3_per_um for one in told.classes], edges_um, color="#0072b2", lw=1.6, label="by volume")
    d_um = np.geomspace(edges_um[0], edges_um[-1], 300)
    for fit in told.fits:
        line, colour = FIT_LINES[fit.name]
        label = f"{fit.told_name}, by volume"
        axes.plot(d_um, d_um * fit.density_per_um(d_um), line, color=colour, lw=1.2, label=label)
    axes.set_ylabel("density per ln d")


def _draw_cumulative(axes: Axes, told: SprayStatistics) -> None:
    edges_um = _edges_um(told)
    curves = {"by number": ("cumulative_q0", "0.5"), "by area": ("cumulative_q2", "#e69f00")}
    for label, (name, colour) in {**curves, "by volume": ("cumulative_q3", "#0072b2")}.items():
        axes.plot(edges_um, [0.0, *(getattr(one, name) for one in told.classes)], color=colour, label=label)
    for name, (label, colour) in MARKED.items():
        if (estimate := getattr(told.droplets, name)) is not None:
            text = f"{label} {estimate.value:.3g} ({estimate.low:.3g} to {estimate.high:.3g}) µm"
            axes.axvline(estimate.value, color=colour, lw=1, label=text)
            axes.axvspan(estimate.low, estimate.high, color=colour, alpha=0.15, lw=0)
    axes.set(ylabel="share of smaller droplets", ylim=(0, 1))
