"""Figures of liquid that is no droplet: break-up curve, objects by class, and what the views see at all."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from processing.analysis.objects.connected_share import ConnectedShare
from processing.analysis.objects.liquid_objects import LiquidObjects, ObjectClass
from processing.analysis.objects.seeing_views import UnseenMap
from processing.figures.colours import VIEW_COLOURS
from processing.geometry import FloatArray
from processing.volume import VoxelGrid

CLASS_COLOURS = {
    ObjectClass.CORE: "#000000",
    ObjectClass.LIGAMENT: "#0072b2",
    ObjectClass.SHEET: "#009e73",
    ObjectClass.CLUSTER: "#d55e00",
}


@dataclass(frozen=True, eq=False)
class BreakUpCurve:
    """Share of the shots that hang together with the nozzle; ``true_mm`` (N,) is where each does, if it is known."""

    share: ConnectedShare
    true_mm: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class ObjectsShot:
    """Objects of an exposure, where too few views see, and the grid of what is drawn."""

    objects: LiquidObjects
    unseen: UnseenMap
    places: VoxelGrid


def objects_figure(curves: Mapping[str, BreakUpCurve], shot: ObjectsShot) -> Figure:
    """All three side by side."""
    figure = Figure(figsize=(14, 4.6), layout="constrained")
    curve_axes, object_axes, map_axes = figure.subplots(1, 3)
    _draw_break_up(curve_axes, curves)
    _draw_objects(object_axes, shot.objects, shot.places)
    _draw_unseen(map_axes, shot.unseen)
    return figure


def break_up_figure(curve: BreakUpCurve | None, name: str, objects: LiquidObjects) -> Figure:
    """Break-up curve, if there is one, and the objects of one exposure."""
    figure = Figure(figsize=(9.5 if curve else 5, 4.4), layout="constrained")
    *curve_axes, object_axes = figure.subplots(1, 2 if curve else 1, squeeze=False).ravel()
    if curve:
        _draw_break_up(curve_axes[0], {name: curve})
    _draw_objects(object_axes, objects, None)
    return figure


def unseen_figure(unseen: UnseenMap) -> Figure:
    """Where too few views see."""
    figure = Figure(figsize=(5.5, 3.8), layout="constrained")
    _draw_unseen(figure.add_subplot(), unseen)
    return figure


def _draw_break_up(axes: Axes, curves: Mapping[str, BreakUpCurve]) -> None:
    """Curves with their intervals, and the truth as broken lines."""
    for (name, curve), colour in zip(curves.items(), VIEW_COLOURS, strict=False):
        share = curve.share
        axes.plot(share.distances_mm, share.share, color=colour, label=name)
        axes.fill_between(share.distances_mm, share.low, share.high, color=colour, alpha=0.2, linewidth=0)
        if curve.true_mm is not None:
            true = np.mean(curve.true_mm[:, None] >= share.distances_mm, axis=0)
            axes.plot(share.distances_mm, true, color=colour, linestyle="--", label=f"{name}, true")
    axes.axhline(0.5, color="0.6", linewidth=0.8)
    axes.set(
        xlabel="distance from the nozzle along the axis [mm]", ylabel="share of shots still connected", ylim=(0, 1.02)
    )
    axes.set_title("break-up, 95 % limits shaded", fontsize="small")
    axes.legend(fontsize="small")
    axes.grid(alpha=0.25)


def _draw_objects(axes: Axes, objects: LiquidObjects, grid: VoxelGrid | None) -> None:
    """Objects seen along z: ligaments as lines of their length and direction, others as circles of their length.

    Axes are those of the grid; without one, they are as wide as the objects.
    """
    for kind, colour in CLASS_COLOURS.items():
        chosen = objects.where(objects.classes == kind)
        if kind is ObjectClass.LIGAMENT:
            _draw_lengths(axes, chosen, colour)
        else:
            _draw_circles(axes, chosen, colour)
        axes.plot([], [], color=colour, linewidth=2, label=f"{kind} ({len(chosen)})")
    _frame(axes, grid)
    axes.set_title("one exposure; circles are as wide as the object is long", fontsize="small")
    axes.legend(fontsize="x-small", loc="upper right")


def _draw_circles(axes: Axes, objects: LiquidObjects, colour: str) -> None:
    for (x_mm, y_mm, _), length_mm in zip(objects.points_mm, objects.lengths_mm, strict=True):
        axes.add_patch(Circle((x_mm, y_mm), length_mm / 2, edgecolor=colour, facecolor="none"))


def _draw_lengths(axes: Axes, objects: LiquidObjects, colour: str) -> None:
    half_mm = objects.directions * objects.lengths_mm[:, None] / 2
    first, last = objects.points_mm - half_mm, objects.points_mm + half_mm
    axes.plot([first[:, 0], last[:, 0]], [first[:, 1], last[:, 1]], color=colour, linewidth=2)


def _draw_unseen(axes: Axes, unseen: UnseenMap) -> None:
    """Share of each line along z that fewer than three views see."""
    share, span_mm = unseen.percent, (*unseen.x_mm, *unseen.y_mm[::-1])
    image = axes.imshow(share, extent=span_mm, cmap="magma_r", vmin=0, vmax=max(1.0, float(share.max())))
    axes.figure.colorbar(image, ax=axes, label="depth seen by < 3 views [%]", shrink=0.75)
    axes.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
    axes.set_title(f"{np.mean(share):.1f} % of the volume is seen by < 3 views", fontsize="small")


def _frame(axes: Axes, grid: VoxelGrid | None) -> None:
    axes.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
    if grid is None:
        axes.autoscale_view()
        axes.invert_yaxis()
    else:
        axes.set(xlim=grid.x_mm[[0, -1]], ylim=grid.y_mm[[-1, 0]])
