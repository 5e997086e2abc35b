"""A figure of how ligaments and sheets move."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from processing.figures.object_figures import CLASS_COLOURS
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
    for kind, colour in CLASS_COLOURS.items():
        _draw_arrows(place_axes, shown.where(shown.classes == kind), colour)
        _draw_speeds(speed_axes, every.where(every.classes == kind), kind, colour)
    place_axes.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
    place_axes.margins(0.15)
    place_axes.invert_yaxis()
    place_axes.set_title("one exposure; the longest arrow is the fastest", fontsize="small")
    speed_axes.set(xlabel="length [mm]", ylabel="speed [m/s]")
    speed_axes.set_title("all exposures; bars are 95 % intervals", fontsize="small")
    speed_axes.legend(fontsize="small")
    for axes in (place_axes, speed_axes):
        axes.grid(alpha=0.25)
    return figure


def _draw_arrows(axes: Axes, moved: MovedObjects, colour: str) -> None:
    if not len(moved):
        return
    (x_mm, y_mm, _), (u, v, _) = moved.points_mm.T, moved.velocities_m_s.T
    axes.plot(x_mm, y_mm, ".", color=colour, markersize=4)
    axes.quiver(x_mm, y_mm, u, v, color=colour, angles="xy", width=0.004)


def _draw_speeds(axes: Axes, moved: MovedObjects, kind: str, colour: str) -> None:
    if not len(moved):
        return
    half = 1.96 * moved.speed_sd_m_s
    name = f"{kind}s ({len(moved)})"
    axes.errorbar(moved.lengths_mm, moved.speeds_m_s, half, fmt="o", markersize=4, color=colour, label=name)
