"""Figures that compare reconstruction methods: quality, droplets found and ghosts, one curve per method."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from processing.figures.colours import method_style
from processing.figures.curve import MethodCurve

Shares = tuple[Sequence[MethodCurve], Sequence[MethodCurve]]
"""By method: share of the droplets that are found, and share of the peaks that are ghosts."""


def quality_figure(
    panels: Mapping[float, Sequence[MethodCurve]], paper: tuple[float, float], window: int, step: int
) -> Figure:
    """Quality factor against droplet density, one curve per method and one panel per sigma (Fig. 7, right).

    Parameters
    ----------
    panels : Mapping[float, sequence of MethodCurve]
        Curves over the density in 1/mm^3, by sigma of the droplets in voxel.
    paper : tuple[float, float]
        The density up to which the paper calls MLOS usable, and the quality factor there.
    window, step : int
        Interrogation windows of the quality factor, in voxels.
    """
    columns = min(2, len(panels))
    lines = -(-len(panels) // columns)
    figure = Figure(figsize=(6.4 * columns, 4.4 * lines), layout="constrained")
    axes_of = figure.subplots(lines, columns, squeeze=False, sharey=True)
    for axes, (sigma_voxel, curves) in zip(axes_of.flat, panels.items(), strict=False):
        _draw_quality(axes, curves, paper)
        axes.set_title(rf"Gaussian droplets of $\sigma$ = {sigma_voxel:g} voxel", fontsize="medium")
    for axes in axes_of.flat[len(panels) :]:
        axes.remove()
    for axes in axes_of[:, 0]:
        axes.set_ylabel("quality factor Q [-]")
    figure.suptitle(f"Q mean-subtracted in {window}³ windows at steps of {step}", fontsize="small")
    return figure


def _draw_quality(axes: Axes, curves: Sequence[MethodCurve], paper: tuple[float, float]) -> None:
    density_per_mm3, quality = paper
    for curve in curves:
        axes.plot(curve.x, curve.y, label=curve.label, **_style(curve))
    axes.axhline(quality, color="0.4", linestyle="--", linewidth=1)
    axes.axvline(density_per_mm3, color="0.4", linestyle="--", linewidth=1)
    axes.plot(density_per_mm3, quality, marker="s", color="0.2", linestyle="none")
    axes.annotate(
        "paper: MLOS usable\nup to about 20 droplets/mm³\n(Q > 0.5)",
        (density_per_mm3, 0.03),
        xytext=(-6, 0),
        textcoords="offset points",
        ha="right",
        fontsize="small",
        color="0.3",
    )
    axes.set_ylim(0, 1.02)
    _density_axis(axes, curves)
    axes.legend(frameon=False, loc="lower left", fontsize="small", handlelength=3.5)


def ghosts_figure(panels: Mapping[str, Shares], limits: tuple[float, float], sigma_voxel: float) -> Figure:
    """Found droplets and ghosts against density in 1/mm^3; one line of panels per choice of the threshold.

    Parameters
    ----------
    panels : Mapping[str, Shares]
        Curves by title.
    limits : tuple[float, float]
        Least share found and largest share of ghosts that tracking can live with.
    sigma_voxel : float
        Width of the droplets.
    """
    least, most = (100 * limit for limit in limits)
    figure = Figure(figsize=(10, 8), layout="constrained")
    axes_of = figure.subplots(len(panels), 2, sharex=True)
    lowest = [min(min(curve.y) for shares in panels.values() for curve in shares[quantity]) for quantity in (0, 1)]
    for (found_axes, ghost_axes), (title, (found, ghosts)) in zip(axes_of, panels.items(), strict=True):
        _draw_shares(found_axes, found, least, lowest[0])
        _draw_shares(ghost_axes, ghosts, most, lowest[1])
        found_axes.set(ylabel="found [% of the droplets]", title=title)
        ghost_axes.set(ylabel="ghosts [% of the peaks]", title=title)
    for axes in axes_of[0]:
        axes.set_xlabel("")
    axes_of[0, 1].legend(frameon=False, loc="upper left", fontsize="small", handlelength=3.5)
    figure.suptitle(
        rf"Gaussian droplets of $\sigma$ = {sigma_voxel:g} voxel; dashed: {least:.0f} % found, {most:.0f} % ghosts"
    )
    return figure


def _draw_shares(axes: Axes, curves: Sequence[MethodCurve], limit_percent: float, lowest: float) -> None:
    for curve in curves:
        axes.plot(curve.x, _percent(curve), label=curve.label, **_style(curve))
    axes.set_ylim(10 * np.floor(10 * lowest) - 2, 102)
    _density_axis(axes, curves)
    axes.axhline(limit_percent, color="0.4", linestyle="--", linewidth=1)


def influences_figure(panels: Mapping[str, Shares], ticked: Collection[str], title: str) -> Figure:
    """Found droplets and ghosts against each influence, one panel each.

    Parameters
    ----------
    panels : Mapping[str, Shares]
        Curves by the label of the axis.
    ticked : collection of str
        Labels of the axes that are marked at every value.
    title : str
        Title of the figure.
    """
    lines = (len(panels) + 1) // 2
    figure = Figure(figsize=(10, 4 * lines), layout="constrained")
    axes_of = figure.subplots(lines, 2, squeeze=False, sharey=True)
    for axes, (label, (found, ghosts)) in zip(axes_of.flat, panels.items(), strict=False):
        for one, other in zip(found, ghosts, strict=True):
            style = {"color": _style(one)["color"], "marker": "o"}
            axes.plot(one.x, _percent(one), label=f"{one.label}, found", **style)
            axes.plot(other.x, _percent(other), label=f"{other.label}, ghosts", linestyle="--", **style)
        axes.set(xlabel=label, ylim=(-3, 103))
        if label in ticked:
            axes.set_xticks(found[-1].x)
        axes.grid(alpha=0.25)
    for axes in axes_of[:, 0]:
        axes.set_ylabel("share [%]")
    axes_of[0, 0].legend(frameon=False, fontsize="small", loc="center left")
    figure.suptitle(title)
    return figure


def _style(curve: MethodCurve) -> dict[str, Any]:
    return method_style(curve.method, curve.iterations)


def _percent(curve: MethodCurve) -> list[float]:
    return [100 * share for share in curve.y]


def _density_axis(axes: Axes, curves: Sequence[MethodCurve]) -> None:
    """A logarithmic axis of densities, marked where they were simulated."""
    densities_per_mm3 = sorted({density for curve in curves for density in curve.x})
    axes.set(xscale="log", xlabel="droplet density [1/mm³]")
    axes.set_xticks(densities_per_mm3, [f"{density:.3g}" for density in densities_per_mm3])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.grid(alpha=0.25)
