"""Panels in rows and columns, with stated room for their labels.

The labels of such figures are known. The layout engine of matplotlib, which measures them, takes as long as drawing.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray


@dataclass(frozen=True)
class Room:
    """Room around and between panels, in inches.

    Parameters
    ----------
    left, right, bottom, top : float
        Between the outer panels and the edges of the figure.
    across, down : float
        Between neighbours in a row, and in a column.
    """

    left: float
    right: float
    bottom: float
    top: float
    across: float = 0.0
    down: float = 0.0


def spaced_panels(figure: Figure, rows: int, columns: int, room: Room) -> NDArray[Any]:
    """Add panels (rows, columns) of one size, of matplotlib's Axes, that leave this room."""
    width, height = figure.get_size_inches()
    panel_width = (width - room.left - room.right + room.across) / columns - room.across
    panel_height = (height - room.bottom - room.top + room.down) / rows - room.down
    arrangement = {
        "left": room.left / width,
        "right": 1 - room.right / width,
        "bottom": room.bottom / height,
        "top": 1 - room.top / height,
        "wspace": room.across / panel_width,
        "hspace": room.down / panel_height,
    }
    panels: NDArray[Any] = figure.subplots(rows, columns, squeeze=False, gridspec_kw=arrangement)
    return panels


LEAST = 1e-9


def rounded_down(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten below a value: for the key of a scale, also where nothing moves."""
    value = max(value, LEAST)
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(step for step in (power, 2 * power, 5 * power) if step <= value * (1 + 1e-9)))
