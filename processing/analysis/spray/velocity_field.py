"""VelocityField: mean velocities of droplets, cell by cell of a slice through the axis of a spray, or across it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.analysis.spray.spray_axis import SprayAxis, corners, direction_name
from processing.analysis.spray.spray_motion import FEWEST
from processing.analysis.spray.spray_sample import SpraySample
from processing.geometry import FloatArray

SLICE = 0.25
"""Of the box's third extent: thickness of a slice."""
THINNEST_MM = 1.0
"""Nor is a slice thinner, unless the box is."""
FEWEST_ROWS = 2
PER_CELL, FEWEST_CELLS, MOST_CELLS = 8, 4, 20
"""Cells are as small as so many droplets each allow; limits are along the longest edge of a slice."""
ALONG, FIRST, SECOND = range(3)
"""Coordinates of a spray: along its axis, and two directions across."""


@dataclass(frozen=True, eq=False)
class VelocityField:
    """Mean velocities, by number, in cells of a slice.

    Parameters
    ----------
    across, down : str
        Which way the columns and the rows go: ``x``, or a vector.
    across_mm, down_mm : (k + 1,) arrays
        Edges of the cells, from the axis, or from the nozzle along it.
    thickness_mm : float
        Of the slice.
    mean_m_s : (rows, columns, 2) array
        Across and down; not a number in cells of fewer than 5 droplets.
    axial_m_s : (rows, columns) array
        Along the axis of the spray; likewise.
    n : (rows, columns) array
        Droplets of a cell that have a velocity; two exposures show the same ones.
    """

    across: str
    down: str
    across_mm: FloatArray
    down_mm: FloatArray
    thickness_mm: float
    mean_m_s: FloatArray
    axial_m_s: FloatArray
    n: NDArray[np.int64]


def field_through_axis(sample: SpraySample, axis: SprayAxis) -> VelocityField | None:
    """The slice that holds the axis; None without a common box, where it is a single row of cells, or none is known."""
    return _field(sample, axis, FIRST, ALONG)


def field_across_axis(sample: SpraySample, axis: SprayAxis) -> VelocityField | None:
    """The slice across the axis, in the middle of the box; None likewise."""
    return _field(sample, axis, FIRST, SECOND)


def _field(sample: SpraySample, axis: SprayAxis, across: int, down: int) -> VelocityField | None:
    if sample.box_mm is None:
        return None
    low_mm, high_mm = _extents(sample.box_mm, axis)
    third = ({ALONG, FIRST, SECOND} - {across, down}).pop()
    extent_mm = float(high_mm[third] - low_mm[third])
    thickness_mm = min(max(SLICE * extent_mm, THINNEST_MM), extent_mm)
    middle_mm = 0.0 if down == ALONG else float(high_mm[third] + low_mm[third]) / 2
    placed_mm = (sample.points_mm - np.array(axis.nozzle_mm)) @ _frame(axis).T
    chosen = sample.paired & (np.abs(placed_mm[:, third] - middle_mm) <= thickness_mm / 2)
    cell_mm = _cell_mm((high_mm - low_mm)[[across, down]], np.count_nonzero(chosen) / sample.exposures_per_shot)
    edges_mm = [_edges(low_mm[one], high_mm[one], cell_mm) for one in (down, across)]
    sums, counts = _sums(placed_mm[chosen][:, [down, across]], edges_mm, sample.velocities_m_s[chosen] @ _frame(axis).T)
    known = counts >= FEWEST * sample.exposures_per_shot
    if not known.any() or len(known) < FEWEST_ROWS:
        return None
    means_m_s = np.where(known[..., None], sums / np.maximum(counts, 1)[..., None], np.nan)
    return VelocityField(
        across=direction_name(_frame(axis)[across]),
        down=direction_name(_frame(axis)[down]),
        across_mm=edges_mm[1],
        down_mm=edges_mm[0],
        thickness_mm=thickness_mm,
        mean_m_s=means_m_s[..., [across, down]],
        axial_m_s=means_m_s[..., ALONG],
        n=np.rint(counts / sample.exposures_per_shot).astype(np.int64),
    )


def _extents(box_mm: FloatArray, axis: SprayAxis) -> tuple[FloatArray, FloatArray]:
    """Of a box in the coordinates of the spray."""
    placed_mm = (corners(box_mm) - np.array(axis.nozzle_mm)) @ _frame(axis).T
    return placed_mm.min(0), placed_mm.max(0)


def _cell_mm(extents_mm: FloatArray, droplets: float) -> float:
    """Width of a cell, of so many droplets that are spread over a slice."""
    longest_mm = float(extents_mm.max())
    evenly_mm = np.sqrt(PER_CELL * float(extents_mm.prod()) / max(droplets, 1.0))
    return float(longest_mm / np.clip(np.floor(longest_mm / evenly_mm), FEWEST_CELLS, MOST_CELLS))


def _edges(low_mm: float, high_mm: float, cell_mm: float) -> FloatArray:
    return np.linspace(low_mm, high_mm, max(round((high_mm - low_mm) / cell_mm), 1) + 1)


def _sums(
    places_mm: FloatArray, edges_mm: list[FloatArray], velocities_m_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Sums of velocities (rows, columns, 3), and droplets (rows, columns)."""
    counts = np.histogramdd(places_mm, edges_mm)[0]
    sums = [np.histogramdd(places_mm, edges_mm, weights=one)[0] for one in velocities_m_s.T]
    return np.stack(sums, axis=-1), counts


def _frame(axis: SprayAxis) -> FloatArray:
    """Rows: the axis, and two directions across it that go up with x, y or z."""
    frame = axis.frame
    for across in frame[1:]:
        across *= np.sign(across[np.abs(across).argmax()])
    return frame
