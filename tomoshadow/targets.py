"""Calibration targets by their names."""

from typing import Literal

from processing.calibration.target.targets import Target
from processing.count import require_count


def Checkerboard(columns: int, rows: int, pitch_mm: float, *, y_axis: Literal["down", "up"] = "down") -> Target:
    """A checkerboard; its points are the inner corners.

    Parameters
    ----------
    columns, rows : int
        Number of inner corners along x and y.
    pitch_mm : float
        Edge of a square.
    y_axis : {"down", "up"}
        Where y grows in the image. With "up", z must grow towards the cameras, or the axes are left-handed.
    """
    _require_counts(columns, rows)
    return Target(kind="checkerboard", columns=columns, rows=rows, pitch_mm=pitch_mm, y_axis=y_axis)


def Dots(
    pitch_mm: float,
    *,
    columns: int | None = None,
    rows: int | None = None,
    y_axis: Literal["down", "up"] = "down",
) -> Target:
    """A plate of dots; its points are their centres.

    Parameters
    ----------
    pitch_mm : float
        Distance of neighbouring dots.
    columns, rows : int, optional
        Number of dots along x and y. A plate that is larger than the image has neither; it needs a marked dot, or
        ``origin_px`` of ``find_target``.
    y_axis : {"down", "up"}
        As for ``Checkerboard``.
    """
    _require_counts(columns, rows)
    return Target(kind="dots", columns=columns, rows=rows, pitch_mm=pitch_mm, y_axis=y_axis)


def _require_counts(columns: int | None, rows: int | None) -> None:
    for name, count in (("columns", columns), ("rows", rows)):
        if count is not None:
            require_count(name, count, 2)
