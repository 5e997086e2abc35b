"""A figure of how ligaments and sheets move."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from processing.analysis.objects.liquid_objects import ObjectClass
from processing.figures.object_figures import CLASS_COLOURS
from processing.figures.spacing import rounded_down
from processing.geometry import FloatArray


@dataclass(frozen=True, eq=False)
class MovedObjects:
    """Objects that have a velocity.

    Parameters
    ----------
    classes : (N,) array of str
        What they are.
    points_mm : (N, 3) array
        Their middles.
    lengths_mm : (N,) array
        Of their longest axes.
    velocities_m_s, sd_m_s : (N, 3) arrays
        u, v, w, and their standard deviations.
    """

    classes: NDArray[np.str_]
    points_mm: FloatArray
    lengths_mm: FloatArray
    velocities_m_s: FloatArray
    sd_m_s: FloatArray

    def __len__(self) -> int:
        return len(self.classes)

    @property
    def speeds_m_s(self) -> FloatArray:
        """Amounts of the velocities (N,)."""
        return np.asarray(np.linalg.norm(self.velocities_m_s, axis=1))

    @property
    def speed_sd_m_s(self) -> FloatArray:
        """Standard deviations of the amounts (N,): along the motion, components taken as independent."""
        along = self.velocities_m_s / np.maximum(self.speeds_m_s, 1e-12)[:, None]
        return np.asarray(np.sqrt(np.sum((along * self.sd_m_s) ** 2, axis=1)))

    def where(self, chosen: NDArray[np.bool_]) -> "MovedObjects":
        """Some of them."""
        names = ("classes", "points_mm", "lengths_mm", "velocities_m_s", "sd_m_s")
        return MovedObjects(*(getattr(self, name)[chosen] for name in names))


def object_motion_figure(shown: MovedObjects, every: MovedObjects) -> Figure:
    """Velocities of the objects of one exposure, seen along z, and speed against length of those of all."""
    figure = Figure(figsize=(9.5, 4.4), layout="constrained")
    place_axes, speed_axes = figure.subplots(1, 2)
    if len(shown):
        _draw_arrows(place_axes, shown)
    place_axes.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
    place_axes.margins(0.25)
    place_axes.invert_yaxis()
    place_axes.set_title("one exposure", fontsize="small", loc="left")
    for kind, colour in CLASS_COLOURS.items():
        _draw_speeds(speed_axes, every.where(every.classes == kind), kind, colour)
    speed_axes.set(xlabel="length [mm]", ylabel="speed [m/s]")
    speed_axes.set_title("all exposures; bars are 95 % intervals", fontsize="small", loc="left")
    figure.legend(loc="outside lower center", ncols=len(CLASS_COLOURS), fontsize="small")
    for axes in (place_axes, speed_axes):
        axes.grid(alpha=0.25)
    return figure


def _draw_arrows(axes: Axes, moved: MovedObjects) -> None:
    """All of one scale, in the colours of the classes."""
    (x_mm, y_mm, _), (u, v, _) = moved.points_mm.T, moved.velocities_m_s.T
    colours = [CLASS_COLOURS[ObjectClass(kind)] for kind in moved.classes]
    axes.scatter(x_mm, y_mm, s=6, c=colours)
    arrows = axes.quiver(x_mm, y_mm, u, v, color=colours, angles="xy", width=0.004)
    key_m_s = rounded_down(float(moved.speeds_m_s.max()))
    axes.quiverkey(arrows, 0.8, 1.04, key_m_s, f"{key_m_s:g} m/s", labelpos="E", fontproperties={"size": "small"})


def _draw_speeds(axes: Axes, moved: MovedObjects, kind: str, colour: str) -> None:
    if not len(moved):
        return
    half, name = 1.96 * moved.speed_sd_m_s, f"{kind}s ({len(moved)})"
    axes.errorbar(moved.lengths_mm, moved.speeds_m_s, half, fmt="o", markersize=4, color=colour, label=name)
