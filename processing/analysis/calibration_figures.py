"""Figures of a calibration: the assigned grid (Fig. 2 of the paper), and error vectors plane by plane."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from processing.analysis.colours import VIEW_COLOURS
from processing.calibration.calibration import Calibration
from processing.calibration.observation import CalibrationSet, PlaneObservation
from processing.geometry import FloatArray

SECTION_STEPS = 2.6
"""Half width of the shown section, in steps of the grid: five by five points and more, each with its coordinates."""
MAX_PLANES = 5
_MARK = "#d55e00"
_LABEL = "#ffd34d"
_QUANTILE = 0.95


def grid_figure(
    images: Mapping[str, NDArray[np.generic]], planes: Mapping[str, PlaneObservation], title: str = ""
) -> Figure:
    """Section of the target as each view sees it, with world coordinates at the points that were found (Fig. 2).

    Parameters
    ----------
    images : Mapping[str, (rows, columns) array]
        Image of the target by view.
    planes : Mapping[str, PlaneObservation]
        The points that were found in each.
    title : str
        Title of the figure.
    """
    figure = Figure(figsize=(4.4 * len(images), 4.7), layout="constrained")
    panels: Sequence[Axes] = np.atleast_1d(figure.subplots(1, len(images))).tolist()
    for axes, (name, image) in zip(panels, images.items(), strict=True):
        _section(axes, image, planes[name])
        z_mm = planes[name].z_mm
        axes.set_title(name + ("" if z_mm is None else f", z = {z_mm:.3g} mm") + "; x, y in mm", fontsize="medium")
        axes.set(xlabel="column [px]", ylabel="row [px]" if axes is panels[0] else "")
    if title:
        figure.suptitle(title)
    return figure


def error_vectors_figure(calibration_set: CalibrationSet, calibration: Calibration) -> Figure:
    """Back-projection errors as arrows over the image, views from top to bottom, planes from left to right.

    Arrows of all panels have one scale; noise points anywhere, a wrong model shows as a pattern. Of more than
    five planes five are shown, evenly spread.
    """
    chosen = {name: _spread(seen.planes) for name, seen in calibration_set.views.items()}
    errors = {
        name: [calibration.views[name].mapping.project(plane.points_mm) - plane.image_px for plane in planes]
        for name, planes in chosen.items()
    }
    lengths_px = np.concatenate([np.linalg.norm(error, axis=1) for view in errors.values() for error in view])
    typical_px = float(np.quantile(lengths_px, _QUANTILE)) or 1.0
    columns = max(map(len, chosen.values()))
    figure = Figure(figsize=(2.7 * columns + 0.6, 2.1 * len(chosen) + 0.5), layout="constrained")
    panels = figure.subplots(len(chosen), columns, squeeze=False)
    for row, ((name, planes), colour) in enumerate(zip(chosen.items(), VIEW_COLOURS, strict=False)):
        size_px = calibration_set.views[name].image_size_px
        for column, axes in enumerate(panels[row]):
            axes.set_axis_off()
            if column < len(planes):
                _arrows(axes, planes[column], errors[name][column], typical_px, size_px, colour)
                where = planes[column].name if planes[column].z_mm is None else f"z = {planes[column].z_mm:.3g} mm"
                mean_px = np.linalg.norm(errors[name][column], axis=1).mean()
                axes.set_title(f"{name}, {where}: {mean_px:.3f} px", fontsize="small")
    figure.suptitle(f"back-projection errors; the bar at the lower left is {typical_px:.2g} px", fontsize="medium")
    return figure


def _section(axes: Axes, image: NDArray[np.generic], plane: PlaneObservation) -> None:
    """The middle of the grid; the points within it carry their x and y."""
    rows, columns = image.shape
    centre_px = plane.image_px[np.linalg.norm(plane.image_px - (columns / 2, rows / 2), axis=1).argmin()]
    distances_px = np.sort(np.linalg.norm(plane.image_px - centre_px, axis=1))
    half_px = SECTION_STEPS * float(distances_px[min(4, len(distances_px) - 1)])
    (left, top), (right, bottom) = centre_px - half_px, centre_px + half_px
    axes.imshow(image, cmap="gray", interpolation="antialiased")
    axes.set(xlim=(left, right), ylim=(bottom, top))
    inside = np.all(np.abs(plane.image_px - centre_px) < half_px, axis=1)
    axes.plot(*plane.image_px[inside].T, marker="+", linestyle="none", color=_MARK, markersize=10, markeredgewidth=1.8)
    for (x_mm, y_mm, _), (u, v) in zip(plane.points_mm[inside], plane.image_px[inside], strict=True):
        axes.annotate(
            f"{x_mm:g}, {y_mm:g}",
            (u, v),
            xytext=(4, 5),
            textcoords="offset points",
            fontsize=7,
            color=_LABEL,
            clip_on=True,
            bbox={"facecolor": "black", "edgecolor": "none", "alpha": 0.75, "pad": 0.8},
        )


def _arrows(
    axes: Axes, plane: PlaneObservation, errors_px: FloatArray, typical_px: float, size_px: tuple[int, int], colour: str
) -> None:
    width_px, height_px = size_px
    length = 0.06 * width_px
    scale = typical_px / length
    axes.quiver(*plane.image_px.T, *errors_px.T, color=colour, angles="xy", scale_units="xy", scale=scale, width=0.004)
    axes.add_patch(Rectangle((0, 0), width_px, height_px, fill=False, edgecolor="0.7", linewidth=0.8))
    axes.plot([0.03 * width_px, 0.03 * width_px + length], [0.95 * height_px] * 2, color="black", linewidth=2)
    axes.set(xlim=(-9, width_px + 9), ylim=(height_px + 9, -9), aspect="equal")


def _spread(planes: Sequence[PlaneObservation]) -> list[PlaneObservation]:
    picked = np.unique(np.linspace(0, len(planes) - 1, min(MAX_PLANES, len(planes))).round().astype(int))
    return [planes[index] for index in picked]
