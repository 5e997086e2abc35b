"""Droplets or tracks as VTKHDF PolyData: points, or lines, for ParaView (docs.vtk.org, VTKHDF file format 2.0)."""

from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from daq.files.atomic_file import replacing
from processing.analysis.droplets.droplet_file import FRAME, PROVENANCE, DropletFileError
from processing.analysis.exports.shot_table import TRACK
from processing.analysis.exports.stored import Stored
from processing.analysis.exports.told_verdict import DOUBTFUL, doubtful, told_texts

FORMAT_VERSION = (2, 0)
CELLS = ("Vertices", "Lines", "Polygons", "Strips")
POSITION = ("x_mm", "y_mm", "z_mm")
EXPOSURE = "exposure"
"""VTK has no columns of letters: 0 is exposure A, 1 is exposure B."""


def write_vtk(path: Path, stored: Stored) -> None:
    """Write a point per droplet, and a line per track; all other columns are arrays of the points.

    Parameters
    ----------
    path : Path
        Usually ``*.vtkhdf``; an existing file is replaced.
    stored : Stored
        Droplets of a shot, or tracks; their provenance is kept as attributes of the group ``/tomoshadow``.

    Raises
    ------
    DropletFileError
        The droplets have no position in space.
    """
    if missing := [name for name in POSITION if name not in stored.columns]:
        raise DropletFileError(f"{path}: droplets without {', '.join(missing)} have no place in space; export csv")
    with replacing(path) as part, h5py.File(part, "w", libver=("v110", "v110")) as file:
        _write_poly_data(file.create_group("VTKHDF", track_order=True), stored)
        file.create_group(PROVENANCE).attrs.update({**told_texts(stored), **stored.provenance})


def _write_poly_data(group: h5py.Group, stored: Stored) -> None:
    points_mm = np.column_stack([stored.columns[name] for name in POSITION])
    group.attrs["Version"] = np.array(FORMAT_VERSION, dtype=np.int64)
    group.attrs.create("Type", b"PolyData", dtype=h5py.string_dtype("ascii", len("PolyData")))
    group["NumberOfPoints"] = np.array([len(points_mm)])
    group["Points"] = points_mm
    filled, offsets = _cells(stored, len(points_mm))
    for cells in CELLS:
        _write_cells(group.create_group(cells), offsets if cells == filled else np.zeros(1, np.int64))
    arrays = group.create_group("PointData", track_order=True)
    arrays[DOUBTFUL] = doubtful(stored)
    for name, column in stored.columns.items():
        if name == FRAME:
            arrays[EXPOSURE] = (column == "b").astype(np.int8)
        elif name not in POSITION:
            arrays[name] = column


def _cells(stored: Stored, points: int) -> tuple[str, NDArray[np.int64]]:
    """Which kind of cells there are, and where each of them begins: a line per track, or a vertex per droplet."""
    if TRACK not in stored.columns:
        return "Vertices", np.arange(points + 1)
    _, first = np.unique(stored.columns[TRACK], return_index=True)
    return "Lines", np.append(np.sort(first), points)


def _write_cells(group: h5py.Group, offsets: NDArray[np.int64]) -> None:
    """Cells of one point after the other."""
    group["NumberOfCells"] = np.array([len(offsets) - 1])
    group["NumberOfConnectivityIds"] = np.array([offsets[-1]])
    group["Offsets"] = offsets
    group["Connectivity"] = np.arange(offsets[-1])
