"""Cells of a box over two of its axes, and which share of each could be measured."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from processing.geometry import FloatArray

CELLS = 24
"""Along the longest edge."""
PLANES = ("xy", "xz")
"""Axes across and down of the maps that are kept."""
Percent = dict[str, list[list[int]]]
"""Of each plane, rows of cells: which share of a cell, through the whole box, could be measured."""
ASKED_POINTS = 40_000
"""All over the box; a share is known to 0.1 %."""
PLASTIC = 1.2207440846057596
"""Its powers spread points evenly in three dimensions (Roberts's sequence)."""
IsMeasured = Callable[[FloatArray], NDArray[np.bool_]]
"""Which of places (N, 3), x, y, z as shares of the box, from 0 to 1, could be measured: (N,)."""
_PER_CELL = 2
"""Places that are asked, along an axis."""


def cells_along(extents: Sequence[float] | FloatArray) -> tuple[int, int, int]:
    """How many cells a box of three extents has along them; their unit does not matter."""
    counts = np.rint(np.round(CELLS * np.asarray(extents, np.float64) / np.max(extents), 6)).astype(int)
    x, y, z = np.maximum(counts, 1).tolist()
    return x, y, z


def measured_share(is_measured: IsMeasured) -> float:
    """Of a box, what could be measured."""
    return float(np.mean(is_measured(np.outer(np.arange(1, ASKED_POINTS + 1), PLASTIC ** -np.arange(1.0, 4.0)) % 1)))


def measured_percent(shape: tuple[int, int, int], is_measured: IsMeasured) -> Percent:
    """Ask places all over a box.

    Parameters
    ----------
    shape : (z, y, x)
        Of the box, in voxels.
    is_measured : callable
        Which places could be measured.
    """
    counts = [_PER_CELL * count for count in cells_along(shape[::-1])]
    x, y, z = ((np.arange(count) + 0.5) / count for count in counts)
    down_z, down_y, across = np.meshgrid(z, y, x, indexing="ij")
    places = np.column_stack([across.ravel(), down_y.ravel(), down_z.ravel()])
    measured = is_measured(places).reshape(down_z.shape)
    return {"xy": _in_cells(measured.mean(axis=0)), "xz": _in_cells(measured.mean(axis=1))}


def _in_cells(shares: FloatArray) -> list[list[int]]:
    rows, columns = (count // _PER_CELL for count in shares.shape)
    cells = shares.reshape(rows, _PER_CELL, columns, _PER_CELL).mean(axis=(1, 3))
    percent: list[list[int]] = np.rint(100 * cells).astype(int).tolist()
    return percent


def measured_shares(shots: Sequence[Sequence[Mapping[str, Any]]], box_mm: FloatArray) -> dict[str, FloatArray]:
    """What files say of the cells of a box, by plane: (S, rows, columns) shares, added up over a shot's exposures.

    Parameters
    ----------
    shots : sequence of sequence
        What was told of the exposures of each shot.
    box_mm : (2, 3) array
        Lower and upper corner.

    Returns
    -------
    dict
        Without the planes of which an exposure says nothing, or of other cells.
    """
    along = dict(zip("xyz", cells_along(box_mm[1] - box_mm[0]), strict=True))
    found = {}
    for plane in PLANES:
        shape = along[plane[1]], along[plane[0]]
        told: list[list[Any]] = [[_share(exposure, plane, shape) for exposure in shot] for shot in shots]
        if told and all(share is not None for shot in told for share in shot):
            found[plane] = np.array([np.sum(shot, axis=0) for shot in told], np.float64)
    return found


def _share(exposure: Mapping[str, Any], plane: str, shape: tuple[int, int]) -> FloatArray | None:
    rows = ((exposure.get("hidden") or {}).get("measured_percent") or {}).get(plane) or []
    if len(rows) != shape[0] or any(len(row) != shape[1] for row in rows):
        return None
    return np.asarray(rows, np.float64) / 100
