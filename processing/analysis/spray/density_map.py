"""DensityMap: droplets per volume that could be measured, column by column through the box, and how shots scatter."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from processing.analysis.cells import PLANES, cells_along
from processing.analysis.spray.spray_sample import SpraySample
from processing.geometry import FloatArray
from processing.reconstruction.settings import FrozenValue

LEAST_MEASURED = 0.5
"""Of a cell: where less could be measured, its density would be that of a small part of it."""
LEAST_ROWS = 4
"""A box that is thinner has no map over that axis."""
NO_CELLS = (
    "files do not say where droplets could be measured: what is hidden is taken off everywhere alike, and behind "
    "liquid the density looks too low; measure again with this version"
)
FEW = (
    "of cells that are null less than half could be measured: liquid hides them, or too few views see them; measure "
    "farther from the nozzle (--grid)"
)
Rows = tuple[tuple[float | None, ...], ...]


@dataclass(frozen=True, eq=False)
class DensityMap:
    """Number density over two axes, mean along the third.

    Parameters
    ----------
    across, down : str
        Names of the axes, x, y or z.
    across_mm, down_mm : (k + 1,) arrays
        Edges of the cells.
    mean_per_mm3 : (rows, columns) array
        Over all exposures, per volume that could be measured; not a number where that is less than half of a cell.
    rms_per_mm3 : (rows, columns) array
        Standard deviation of shots, of those that saw half of what the best one saw; not a number of fewer than two.
    chance_per_mm3 : (rows, columns) array
        What counting alone would make of it (Poisson).
    measured_share : (rows, columns) array | None
        Of the volume of each cell; None where files do not say it, and what is hidden is taken off everywhere alike.
    """

    across: str
    down: str
    across_mm: FloatArray
    down_mm: FloatArray
    mean_per_mm3: FloatArray
    rms_per_mm3: FloatArray
    chance_per_mm3: FloatArray
    measured_share: FloatArray | None = None


def density_maps(sample: SpraySample) -> list[DensityMap]:
    """Maps over the planes of which files say what could be measured, of boxes that are thick enough."""
    found = (density_map(sample, *plane) for plane in PLANES)
    return [one for one in found if one and len(one.mean_per_mm3) >= LEAST_ROWS]


def density_map(sample: SpraySample, across: str = "x", down: str = "y") -> DensityMap | None:
    """Number density of a sample over two axes; None where shots were measured in several boxes.

    Parameters
    ----------
    sample : SpraySample
        The droplets.
    across, down : str
        Axes of the map.
    """
    if sample.box_mm is None:
        return None
    first, second = "xyz".index(across), "xyz".index(down)
    cells = cells_along(np.diff(sample.box_mm, axis=0)[0])
    edges_mm = [_edges_mm(sample.box_mm[:, axis], cells[axis]) for axis in (second, first)]
    places = [np.arange(len(sample.volumes_mm3) + 1) - 0.5, *edges_mm]
    values = np.column_stack([sample.shot, sample.points_mm[:, second], sample.points_mm[:, first]])
    counts, _ = np.histogramdd(values, bins=places)
    cell_mm3, measured = _volumes(sample, across + down, counts)
    enough = np.ones(counts.shape[1:], bool) if measured is None else measured >= LEAST_MEASURED
    mean = np.where(enough, _over(counts.sum(axis=0), cell_mm3.sum(axis=0)), np.nan)
    chance = np.sqrt(sample.exposures_per_shot * _over(mean, cell_mm3.mean(axis=0)))  # A and B show the same droplets
    rms = np.where(enough, _scatter(counts, cell_mm3), np.nan)
    return DensityMap(across, down, edges_mm[1], edges_mm[0], mean, rms, chance, measured)


def _edges_mm(span_mm: FloatArray, cells: int) -> FloatArray:
    return np.linspace(span_mm[0], span_mm[1], cells + 1)


def _volumes(sample: SpraySample, plane: str, counts: FloatArray) -> tuple[FloatArray, FloatArray | None]:
    """What could be measured of each cell in each shot, (S, rows, columns), and which share of it in all."""
    shares = sample.measured_shares.get(plane)
    if shares is None or sample.box_mm is None:
        return np.broadcast_to(sample.volumes_mm3[:, None, None] / counts[0].size, counts.shape), None
    whole_mm3 = float(np.prod(np.diff(sample.box_mm, axis=0))) / counts[0].size
    return whole_mm3 * shares, shares.mean(axis=0) / sample.exposures_per_shot


def _over(values: FloatArray, volumes_mm3: FloatArray) -> FloatArray:
    """Values per volume; not a number where there is none."""
    density: FloatArray = np.divide(values, volumes_mm3, out=np.full(values.shape, np.nan), where=volumes_mm3 > 0)
    return density


def _scatter(counts: FloatArray, cell_mm3: FloatArray) -> FloatArray:
    """Standard deviation of density over the shots that saw half of a cell; each weighs as much as it saw of it."""
    seen = cell_mm3 >= LEAST_MEASURED * cell_mm3.max(axis=0)
    n, volumes_mm3, shots = counts * seen, cell_mm3 * seen, seen.sum(axis=0)
    together_mm3 = volumes_mm3.sum(axis=0)
    squares = volumes_mm3 * (_over(n, volumes_mm3) - _over(n.sum(axis=0), together_mm3)) ** 2
    variance = _over(shots * np.nansum(squares, axis=0), together_mm3) / np.maximum(shots - 1, 1)
    return np.asarray(np.where(shots > 1, np.sqrt(variance), np.nan), np.float64)


class ToldDensity(FrozenValue):
    """A map as JSON has it: rows of cells, null where nothing is known."""

    across: Annotated[str, Field(description="axis along a row: x, y or z")]
    down: Annotated[str, Field(description="axis from row to row")]
    across_mm: Annotated[tuple[float, ...], Field(description="edges of the cells of a row")]
    down_mm: Annotated[tuple[float, ...], Field(description="edges of the rows")]
    mean_per_mm3: Annotated[Rows, Field(description="null where less than half of a cell could be measured")]
    rms_per_mm3: Annotated[Rows, Field(description="standard deviation of shots; null of fewer than two")]
    chance_per_mm3: Annotated[Rows, Field(description="what counting alone would make of it")]
    measured_share: Annotated[Rows | None, Field(description="of the volume of each cell")] = None
    reason: Annotated[str | None, Field(description="why there are no shares, and why cells are null")] = None

    @classmethod
    def of(cls, one: DensityMap) -> "ToldDensity":
        """Four digits of each number."""
        few = one.measured_share is not None and bool((one.measured_share < LEAST_MEASURED).any())
        return cls(
            across=one.across,
            down=one.down,
            across_mm=tuple(one.across_mm.tolist()),
            down_mm=tuple(one.down_mm.tolist()),
            mean_per_mm3=_rows(one.mean_per_mm3),
            rms_per_mm3=_rows(one.rms_per_mm3),
            chance_per_mm3=_rows(one.chance_per_mm3),
            measured_share=None if one.measured_share is None else _rows(one.measured_share),
            reason=NO_CELLS if one.measured_share is None else FEW if few else None,
        )


def _rows(values: FloatArray) -> Rows:
    return tuple(tuple(None if np.isnan(one) else float(f"{one:.4g}") for one in row) for row in values)
