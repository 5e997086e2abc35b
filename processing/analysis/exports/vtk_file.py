"""Droplets as VTKHDF PolyData, points that ParaView opens (docs.vtk.org, VTKHDF file format 2.0)."""

from pathlib import Path

import h5py
import numpy as np

from daq.files.atomic_file import replacing
from processing.analysis.droplets.droplet_file import FRAME, PROVENANCE, DropletFileError, StoredDroplets

FORMAT_VERSION = (2, 0)
CELLS = ("Vertices", "Lines", "Polygons", "Strips")
POSITION = ("x_mm", "y_mm", "z_mm")
EXPOSURE = "exposure"
"""VTK has no columns of letters: 0 is exposure A, 1 is exposure B."""


def write_vtk(path: Path, droplets: StoredDroplets) -> None:
    """Write a point per droplet; all other columns are arrays of the points.

    Parameters
    ----------
    path : Path
        Usually ``*.vtkhdf``; an existing file is replaced.
    droplets : StoredDroplets
        Of a shot; its provenance is kept as attributes of the group ``/tomoshadow``.

    Raises
    ------
    DropletFileError
        The droplets have no position in space.
    """
    if missing := [name for name in POSITION if name not in droplets.columns]:
        raise DropletFileError(f"{path}: droplets without {', '.join(missing)} have no place in space; export csv")
    with replacing(path) as part, h5py.File(part, "w", libver=("v110", "v110")) as file:
        _write_poly_data(file.create_group("VTKHDF", track_order=True), droplets)
        file.create_group(PROVENANCE).attrs.update(droplets.provenance)


def _write_poly_data(group: h5py.Group, droplets: StoredDroplets) -> None:
    points_mm = np.column_stack([droplets.columns[name] for name in POSITION])
    group.attrs["Version"] = np.array(FORMAT_VERSION, dtype=np.int64)
    group.attrs.create("Type", b"PolyData", dtype=h5py.string_dtype("ascii", len("PolyData")))
    group["NumberOfPoints"] = np.array([len(points_mm)])
    group["Points"] = points_mm
    for cells in CELLS:
        _write_cells(group.create_group(cells), len(points_mm) if cells == "Vertices" else 0)
    arrays = group.create_group("PointData", track_order=True)
    for name, column in droplets.columns.items():
        if name == FRAME:
            arrays[EXPOSURE] = (column == "b").astype(np.int8)
        elif name not in POSITION:
            arrays[name] = column


def _write_cells(group: h5py.Group, n: int) -> None:
    """Cells of one point each."""
    group["NumberOfCells"] = np.array([n])
    group["NumberOfConnectivityIds"] = np.array([n])
    group["Offsets"] = np.arange(n + 1)
    group["Connectivity"] = np.arange(n)
