"""Where the liquid goes: patternation around the axis, and maps of the number density."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes

from processing.analysis.spray.density_map import DensityMap
from processing.analysis.spray.patternation import Patternation
from processing.geometry import FloatArray

ARC = 16
"""Straight edges of the arc of a sector."""
PER_MM3 = "droplets [1/mm³]"


def patternation_figure(one: Patternation) -> Figure:
    """Liquid by cells as a disc around the axis, and shares of the sectors with their intervals."""
    figure = Figure(figsize=(9.5, 4.2), layout="constrained")
    grid = figure.add_gridspec(1, 2, width_ratios=(1, 1.05))
    disc = figure.add_subplot(grid[0, 0], projection="polar")
    if not isinstance(disc, PolarAxes):
        raise TypeError("matplotlib makes no polar axes")
    ppm = np.array([[np.nan if value is None else value for value in ring] for ring in one.liquid_ppm])
    edges = np.linspace(0, 2 * np.pi, ARC * one.sectors + 1)
    cells = np.ma.masked_invalid(np.repeat(ppm, ARC, axis=1))
    mesh = disc.pcolormesh(edges, np.array(one.ring_edges_mm), cells, cmap="viridis", vmin=0, rasterized=True)
    disc.set_facecolor("0.85")
    disc.grid(visible=False)
    disc.set_xticks(np.radians(range(0, 360, 45)), _azimuth_labels(one))
    disc.set_yticks(np.round(one.ring_edges_mm[1:], 1))
    disc.tick_params(axis="y", colors="white")
    disc.tick_params(labelsize="x-small")
    figure.colorbar(mesh, ax=disc, label="liquid [ppm of volume]", shrink=0.7, pad=0.12)
    disc.set_title(f"{one.at_mm:.3g} mm from the nozzle, rings in mm", fontsize="small")
    _draw_shares(figure.add_subplot(grid[0, 1]), one)
    return figure


def _azimuth_labels(one: Patternation) -> list[str]:
    """Degrees, and at two of them which way that is."""
    named = dict(zip((0, 90), one.azimuths, strict=True))
    return [f"{degrees}°" + (f" ({named[degrees]})" if degrees in named else "") for degrees in range(0, 360, 45)]


def _draw_shares(axes: Axes, one: Patternation) -> None:
    axes.axhline(100 / one.sectors, color="0.6", lw=1, ls="--", label="even")
    known = [(number, share) for number, share in enumerate(one.sector_shares) if share]
    if known:
        values, lows, highs = 100 * np.array([[share.value, share.low, share.high] for _, share in known]).T
        places = [(number + 0.5) * 360 / one.sectors for number, _ in known]
        axes.bar(places, values, 0.9 * 360 / one.sectors, color="#9ecae1")
        axes.errorbar(places, values, [values - lows, highs - values], fmt="none", ecolor="0.3", capsize=3)
    title = (
        "" if one.asymmetry is None else f"asymmetry {one.asymmetry:.3f}, by chance below {one.asymmetry_by_chance:.3f}"
    )
    axes.set_title(title, fontsize="small")
    axes.set(xlabel=f"azimuth from {one.azimuths[0]} [°]", ylabel=f"share [%], {one.weighting}")
    axes.set(xlim=(0, 360), ylim=(0, None), xticks=range(0, 361, 45))
    axes.legend(fontsize="x-small")


def density_figure(maps: Sequence[DensityMap]) -> Figure:
    """Mean number density, of several shots how they scatter, and which share could be measured if not all was.

    Parameters
    ----------
    maps : sequence of DensityMap
        Over two axes each; a row of pictures, or of those with a single picture side by side.
    """
    panels = [_panels(one) for one in maps]
    most = max(map(len, panels))
    shape = (len(maps), most) if most > 1 else (1, len(maps))
    figure = Figure(figsize=(4.75 * shape[1] if shape[1] > 1 else 5, 3.6 * shape[0]), layout="constrained")
    axes = np.array(figure.subplots(*shape, squeeze=False), dtype=object).reshape(len(maps), -1)
    for places, one, drawn in zip(axes, maps, panels, strict=True):
        for place, (values, title, label) in zip(places, drawn, strict=False):
            _draw_map(place, one, values, title, label)
        for place in places[len(drawn) :]:
            place.set_axis_off()
    return figure


def _panels(one: DensityMap) -> list[tuple[FloatArray, str, str]]:
    """Values, title and what they are."""
    panels = [(one.mean_per_mm3, "mean", PER_MM3)]
    if np.isfinite(one.rms_per_mm3).any():
        rms, chance = float(np.nanmean(one.rms_per_mm3)), float(np.nanmean(one.chance_per_mm3))
        title = f"rms of the shots: mean {rms:.3g}, by counting alone {chance:.3g}"
        panels.append((one.rms_per_mm3, title, PER_MM3))
    if one.measured_share is not None and (one.measured_share < 1).any():
        title = f"{100 * float(np.mean(one.measured_share)):.3g} % of the volume could be measured"
        panels.append((100 * one.measured_share, title, "could be measured [%]"))
    return panels


def _draw_map(axes: Axes, one: DensityMap, values: FloatArray, title: str, label: str) -> None:
    mesh = axes.pcolormesh(
        one.across_mm, one.down_mm, np.ma.masked_invalid(values), cmap="viridis", vmin=0, rasterized=True
    )
    axes.set_facecolor("0.85")
    axes.set(aspect="equal", xlabel=f"{one.across} [mm]", ylabel=f"{one.down} [mm]")
    if one.down == "y":
        axes.invert_yaxis()
    axes.figure.colorbar(mesh, ax=axes, label=label, shrink=0.8)
    axes.set_title(title, fontsize="small")
