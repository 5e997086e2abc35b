"""Figures of a calibration: the assigned grid (Fig. 2 of the paper), and error vectors plane by plane."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from processing.calibration.calibration import Calibration
from processing.calibration.observation import CalibrationSet, PlaneObservation
from processing.figures.colours import VIEW_COLOURS
from processing.figures.spacing import Room, spaced_panels
from processing.geometry import FloatArray

SECTION_STEPS = 2.6
"""Half width of the shown section, in steps of the grid: five by five points and more, each with its coordinates."""
MAX_PLANES = 5
MAX_COLUMNS = 2
"""Sections of the target side by side; more of them would leave no room for their labels."""
MAX_ARROWS = 130
"""Arrows of a plane; more of them would have to be so short that nobody sees where they point."""
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
    columns = min(MAX_COLUMNS, len(images))
    rows = -(-len(images) // columns)
    figure = Figure(figsize=(5.6 * columns, 5.9 * rows))
    room = Room(left=0.75, right=0.15, bottom=0.55, top=0.7 if title else 0.4, across=0.8, down=0.85)
    panels = spaced_panels(figure, rows, columns, room)
    for axes, (name, image) in zip(panels.flat, images.items(), strict=False):
        _section(axes, image, planes[name])
        z_mm = planes[name].z_mm
        axes.set_title(name + ("" if z_mm is None else f", z = {_rounded(z_mm)} mm") + "; x, y in mm")
        axes.set(xlabel="column [px]", ylabel="row [px]")
    for axes in panels.flat[len(images) :]:
        axes.remove()
    if title:
        figure.suptitle(title)
    return figure


def error_vectors_figure(calibration_set: CalibrationSet, calibration: Calibration) -> Figure:
    """Back-projection errors as arrows over the image, views from top to bottom, planes from left to right.

    Arrows of all panels have one scale; noise points anywhere, a wrong model shows as a pattern. Of more than
    five planes five are shown, evenly spread, and of a fine grid every second or third line; the figures are those of
    all points.
    """
    chosen = {name: _spread(seen.planes) for name, seen in calibration_set.views.items()}
    errors = {
        name: [calibration.views[name].mapping.project(plane.points_mm) - plane.image_px for plane in planes]
        for name, planes in chosen.items()
    }
    lengths_px = np.concatenate([np.linalg.norm(error, axis=1) for view in errors.values() for error in view])
    typical_px = float(np.quantile(lengths_px, _QUANTILE)) or 1.0
    columns = max(map(len, chosen.values()))
    figure = Figure(figsize=(3.3 * columns + 0.6, 2.9 * len(chosen) + 0.8))
    room = Room(left=0.7, right=0.2, bottom=0.5, top=1.25, across=0.6, down=0.75)
    panels = spaced_panels(figure, len(chosen), columns, room)
    for row, ((name, planes), colour) in enumerate(zip(chosen.items(), VIEW_COLOURS, strict=False)):
        size_px = calibration_set.views[name].image_size_px
        for column, axes in enumerate(panels[row]):
            if column >= len(planes):
                axes.set_axis_off()
                continue
            _arrows(axes, planes[column], errors[name][column], typical_px, size_px, colour)
            axes.set_title(_panel_title(name, planes[column], errors[name][column]), fontsize="medium")
            axes.set(ylabel="row [px]" if column == 0 else "", xlabel="column [px]" if row == len(chosen) - 1 else "")
    told = f"back-projection errors, mean and largest;\nthe bar at the lower left is {typical_px:.2g} px"
    figure.suptitle(told, fontsize="medium")
    return figure


def _panel_title(view: str, plane: PlaneObservation, errors_px: FloatArray) -> str:
    where = plane.name if plane.z_mm is None else f"z = {_rounded(plane.z_mm)} mm"
    lengths_px = np.linalg.norm(errors_px, axis=1)
    return f"{view}, {where}\n{lengths_px.mean():.3f} px, {lengths_px.max():.2f} px at most"


def _rounded(z_mm: float) -> str:
    """A position as a person would say it; stages stop within micrometres of it."""
    return f"{round(z_mm, 2) + 0.0:g}"


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
    axes.plot(*plane.image_px[inside].T, marker="+", linestyle="none", color=_MARK, markersize=12, markeredgewidth=2)
    for (x_mm, y_mm, _), (u, v) in zip(plane.points_mm[inside], plane.image_px[inside], strict=True):
        axes.annotate(
            f"{x_mm + 0.0:g}, {y_mm + 0.0:g}",  # of a target whose y points up, 0 is -0
            (u, v),
            xytext=(4, 5),
            textcoords="offset points",
            fontsize=10,
            color=_LABEL,
            clip_on=True,
            bbox={"facecolor": "black", "edgecolor": "none", "alpha": 0.75, "pad": 0.8},
        )


def _arrows(
    axes: Axes, plane: PlaneObservation, errors_px: FloatArray, typical_px: float, size_px: tuple[int, int], colour: str
) -> None:
    width_px, height_px = size_px
    length = 0.12 * width_px
    shown = _thinned(plane.points_mm)
    axes.quiver(
        *plane.image_px[shown].T,
        *errors_px[shown].T,
        color=colour,
        angles="xy",
        scale_units="xy",
        scale=typical_px / length,
        width=0.007,
    )
    axes.plot([0.03 * width_px, 0.03 * width_px + length], [0.95 * height_px] * 2, color="black", linewidth=2.5)
    axes.set(xlim=(0, width_px), ylim=(height_px, 0), aspect="equal")
    axes.set_xticks(np.linspace(0, width_px, 3).round())
    axes.set_yticks(np.linspace(0, height_px, 3).round())
    axes.tick_params(labelsize="small")


def _thinned(points_mm: FloatArray) -> NDArray[np.bool_]:
    """Which points (N,) to show: of a grid every n-th column and row."""
    step = int(np.ceil(np.sqrt(len(points_mm) / MAX_ARROWS)))
    lines = np.stack([np.unique(values.round(6), return_inverse=True)[1] for values in points_mm[:, :2].T])
    return np.asarray((lines % step == 0).all(axis=0), dtype=np.bool_)


def _spread(planes: Sequence[PlaneObservation]) -> list[PlaneObservation]:
    picked = np.unique(np.linspace(0, len(planes) - 1, min(MAX_PLANES, len(planes))).round().astype(int))
    return [planes[index] for index in picked]
