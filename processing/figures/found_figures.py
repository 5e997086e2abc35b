"""Figures of measured droplets beside the true ones, which only a simulation knows."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from processing.geometry import FloatArray

CLASSES_UM = np.geomspace(10, 270, 19)
"""Edges of the classes of diameters; one is 30 um, from which on droplets are counted."""
AREA_PER_UM2 = 0.012
"""Of a marker, in square points."""


@dataclass(frozen=True, eq=False)
class Placed:
    """Droplets where they are, with their diameters.

    Parameters
    ----------
    points_mm : (N, 3) array
        Centres.
    diameters_um : (N,) array
        Diameters.
    """

    points_mm: FloatArray
    diameters_um: FloatArray

    def __len__(self) -> int:
        return len(self.diameters_um)


def found_figure(found: Placed, missed: Placed, ghosts: Placed, title: str = "") -> Figure:
    """Seen along the axis of the spray, and by size: true droplets that were found, those that were not, and ghosts."""
    figure = Figure(figsize=(9.5, 4.5), layout="constrained")
    above, by_size = figure.subplots(1, 2)
    for droplets, colour, label in (
        (found, "0.55", "found"),
        (missed, "tab:red", "missed"),
        (ghosts, "tab:blue", "ghosts"),
    ):
        _draw_from_above(above, droplets, colour, f"{label}: {len(droplets)}")
    above.set(xlabel="x [mm]", ylabel="z [mm]", aspect="equal", title="from above")
    above.legend(fontsize="small")
    by_size.hist(
        [found.diameters_um, missed.diameters_um, ghosts.diameters_um],
        bins=list(CLASSES_UM),
        stacked=True,
        color=["0.55", "tab:red", "tab:blue"],
    )
    by_size.set(xlabel="diameter [µm]", ylabel="droplets", xscale="log", title="by size")
    by_size.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    by_size.xaxis.set_major_formatter("{x:g}")
    by_size.xaxis.set_minor_formatter(NullFormatter())
    figure.suptitle(title)
    return figure


def _draw_from_above(axes: Axes, droplets: Placed, colour: str, label: str) -> None:
    x_mm, _, z_mm = droplets.points_mm.T
    axes.scatter(x_mm, z_mm, s=AREA_PER_UM2 * droplets.diameters_um**2, c=colour, alpha=0.7, linewidths=0)
    axes.plot([], [], "o", color=colour, alpha=0.7, markeredgewidth=0, label=label)
