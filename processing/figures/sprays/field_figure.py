"""Which way droplets fly: mean velocities by cells, as arrows, in a slice through the axis and in one across it."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from processing.analysis.spray.velocity_field import VelocityField
from processing.figures.spacing import rounded_down
from processing.geometry import FloatArray

PANEL_IN, HEIGHT_IN = 4.75, 4.2
ARROW_CELLS = 0.9
"""Length of the longest arrow, in cells."""


def velocity_field_figure(through: VelocityField | None, across: VelocityField | None) -> Figure:
    """Arrows are mean velocities within the slice; colours are droplets, and velocities along the axis.

    Parameters
    ----------
    through : VelocityField | None
        The slice through the axis: colours are numbers of droplets.
    across : VelocityField | None
        The slice across the axis: colours are velocities along it. Cells without arrow have too few droplets.
    """
    fields = [one for one in (through, across) if one]
    figure = Figure(figsize=(PANEL_IN * len(fields), HEIGHT_IN), layout="constrained")
    for axes, field in zip(figure.subplots(1, len(fields), squeeze=False).ravel(), fields, strict=True):
        if field is through:
            _draw(
                axes,
                field,
                np.where(field.n > 0, field.n.astype(np.float64), np.nan),
                "droplets in a cell",
                "Blues",
                0.0,
            )
            axes.set(ylabel="along the axis, from the nozzle [mm]")
            axes.invert_yaxis()
        else:
            _draw(axes, field, field.axial_m_s, "mean velocity along the axis [m/s]", "viridis")
            axes.set(ylabel=f"{field.down} from the axis [mm]")
    return figure


def _draw(
    axes: Axes, field: VelocityField, colours: FloatArray, label: str, cmap: str, least: float | None = None
) -> None:
    axes.set_facecolor("0.92")
    shown = np.ma.masked_invalid(colours)
    mesh = axes.pcolormesh(field.across_mm, field.down_mm, shown, cmap=cmap, alpha=0.5, vmin=least, rasterized=True)
    axes.figure.colorbar(mesh, ax=axes, label=label, shrink=0.8)
    middles_mm = [(edges[:-1] + edges[1:]) / 2 for edges in (field.across_mm, field.down_mm)]
    longest_m_s = float(np.nanmax(np.linalg.norm(field.mean_m_s, axis=-1)))
    cell_mm = float(np.diff(field.across_mm)[0])
    arrows = axes.quiver(
        *np.meshgrid(*middles_mm),
        *np.moveaxis(field.mean_m_s, -1, 0),
        angles="xy",
        scale_units="xy",
        scale=longest_m_s / (ARROW_CELLS * cell_mm),
        pivot="mid",
        width=0.006,
    )
    key_m_s = rounded_down(longest_m_s)
    axes.quiverkey(arrows, 0.8, 1.04, key_m_s, f"{key_m_s:g} m/s", labelpos="E", fontproperties={"size": "small"})
    axes.set(xlabel=f"{field.across} from the axis [mm]", aspect="equal")
    axes.set_title(f"slice of {field.thickness_mm:.2g} mm", fontsize="small", loc="left")
