"""Figures of the back-projection error over the calibration planes (Fig. 3 of the paper)."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from processing.calibration.calibration import Calibration
from processing.figures.colours import VIEW_COLOURS
from processing.figures.curve import Curve

PAPER_LIMIT_PX = 0.05


def residuals_figure(calibration: Calibration) -> Figure:
    """Mean back-projection error (eq. 2) of each view over the calibration planes.

    Boards in free poses, which have no z, are numbered instead.
    """
    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.subplots()
    highest_px, xlabel = PAPER_LIMIT_PX, "plane z [mm]"
    for (name, view), colour in zip(calibration.views.items(), VIEW_COLOURS, strict=False):
        errors_px = [plane.mean_error_px for plane in view.planes]
        positions = [plane.z_mm for plane in view.planes if plane.z_mm is not None]
        if len(positions) < len(errors_px):
            positions, xlabel = [float(number) for number in range(1, len(errors_px) + 1)], "board"
        label = f"{name} (hold-out {view.holdout_error_px:.3f} px)"
        axes.plot(positions, errors_px, marker="o", color=colour, label=label)
        highest_px = max(highest_px, *errors_px)
    _draw_limit(axes)
    axes.set(xlabel=xlabel, ylabel="mean back-projection error [px]", ylim=(0, 1.15 * highest_px))
    axes.legend(frameon=False, fontsize="small")
    return figure


def detection_residuals_figure(detected: Sequence[Curve], ideal: Sequence[Curve]) -> Figure:
    """Mean back-projection error of detected corners over the planes, and what is left of ideal points.

    Parameters
    ----------
    detected, ideal : sequence of Curve
        Errors in px over z in mm, by view; labels name the views.
    """
    figure = Figure(figsize=(6.8, 4.4), layout="constrained")
    axes = figure.subplots()
    for number, (corners, points) in enumerate(zip(detected, ideal, strict=True)):
        colour = VIEW_COLOURS[number % len(VIEW_COLOURS)]
        axes.plot(corners.x, corners.y, color=colour, marker="o", label=f"{corners.label}, corners detected in images")
        label = "all views, ideal points" if points is ideal[-1] else None
        axes.plot(points.x, points.y, color="0.2", linestyle=":", label=label)
    _draw_limit(axes)
    highest_px = max(PAPER_LIMIT_PX, *(error_px for curve in (*detected, *ideal) for error_px in curve.y))
    axes.set(
        xlabel="plane z [mm]", ylabel="mean back-projection error [px]", ylim=(-0.02 * highest_px, 1.15 * highest_px)
    )
    axes.grid(alpha=0.25)
    axes.legend(frameon=False, fontsize="small", loc="center", bbox_to_anchor=(0.5, 0.6))
    return figure


def _draw_limit(axes: Axes) -> None:
    place = (0.01, PAPER_LIMIT_PX)
    axes.axhline(PAPER_LIMIT_PX, color="0.4", linestyle="--", linewidth=1)
    axes.annotate("paper: < 0.05 px", place, xycoords=("axes fraction", "data"), va="bottom", color="0.4")
