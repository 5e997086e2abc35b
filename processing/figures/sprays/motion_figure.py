"""How fast droplets fly: against their diameter, and against their distance from the axis."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter
from numpy.typing import ArrayLike

from processing.analysis.estimates import Estimate
from processing.analysis.spray.spray_motion import SprayMotion, VelocityRow

MOST_DOTS = 4000


def motion_figure(motion: SprayMotion, diameters_um: ArrayLike, speeds_m_s: ArrayLike) -> Figure:
    """Speed against diameter, each droplet a dot, means of the classes with their intervals; profiles across the axis.

    Parameters
    ----------
    motion : SprayMotion
        Of the spray.
    diameters_um, speeds_m_s : (N,) arrays
        Of the droplets; without a speed not a number. At most 4000 are drawn.
    """
    figure = Figure(figsize=(9.5, 4.2), layout="constrained")
    by_size, by_radius = figure.subplots(1, 2)
    d_um, speeds = np.asarray(diameters_um, np.float64), np.asarray(speeds_m_s, np.float64)
    step = max(len(d_um) // MOST_DOTS, 1)
    by_size.plot(d_um[::step], speeds[::step], ".", color="0.7", ms=2, rasterized=True, label="droplets")
    _draw_means(by_size, motion.by_size, "speed_m_s", "speed, mean of a class", "#0072b2")
    by_size.set(xscale="log", xlabel="diameter d [µm]", ylabel="speed [m/s]")
    by_size.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    by_size.xaxis.set_major_formatter("{x:g}")
    by_size.xaxis.set_minor_formatter(NullFormatter())
    by_size.set_title(_correlation(motion.size_speed_correlation), fontsize="small")
    for name, label, colour in (("axial_m_s", "axial", "#0072b2"), ("radial_m_s", "radial", "#d55e00")):
        _draw_means(by_radius, motion.by_radius, name, label, colour)
    by_radius.set(xlabel="distance from the axis [mm]", ylabel="mean velocity [m/s]")
    if not motion.by_radius:
        by_radius.set_title("no axis, no profile", fontsize="small")
    for axes in (by_size, by_radius):
        axes.grid(alpha=0.25)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize="x-small")
    return figure


def _correlation(one: Estimate | None) -> str:
    return "" if one is None else f"rank correlation {one.value:.2f} ({one.low:.2f} to {one.high:.2f})"


def _draw_means(axes: Axes, rows: tuple[VelocityRow, ...], name: str, label: str, colour: str) -> None:
    known = [(row, estimate) for row in rows if (estimate := getattr(row, name))]
    if not known:
        return
    places = [np.sqrt(row.low * row.high) if row.low else row.high / 2 for row, _ in known]
    values, lows, highs = np.array([[one.value, one.low, one.high] for _, one in known]).T
    limits = [values - lows, highs - values]
    axes.errorbar(places, values, limits, fmt="o-", color=colour, ms=4, lw=1.2, capsize=2, label=label)
