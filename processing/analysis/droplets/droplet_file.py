"""Droplets of a shot in an HDF5 file: 1-D columns, a row per droplet and exposure."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import h5py
import numpy as np
from numpy.typing import NDArray

from daq.files.atomic_file import own_part_path, replacing
from processing.analysis.droplets.droplet_table import P_REAL_UNKNOWN, Columns, DropletRows
from processing.errors import BadInput

SCHEMA, SCHEMA_VERSION = "tomoshadow/droplets", 3
"""1: bright particles, which have amplitudes; 2: shadows, which have diameters; 3: either, with velocities where there
are two exposures and the time between them is known."""
SCHEMA_KEYS = ("schema", "schema_version")
DIAMETER, RAW_DIAMETER = "diameter_um", "diameter_raw_um"
NOT_CORRECTED = "none: blur is Gaussian, diameter_um is diameter_raw_um, as fitted"
CORRECTED = (
    "of diffraction in light whose condenser_ratio is with the views of the exposures; diameter_raw_um is that of the "
    "disc that would look so behind a Gaussian blur. Where the settings have sizes, by the dots of a reticle, too"
)
GROUP, PROVENANCE, FRAME, ROWS = "droplets", "tomoshadow", "frame", "rows"
_UNITS = {"mm": "mm", "mm2": "mm^2", "um": "um", "px": "px", "m_s": "m/s", "m2_s2": "m^2/s^2", "m_s2": "m/s^2"}
UNITS = MappingProxyType({f"_{ending}": unit for ending, unit in _UNITS.items()})
"""By the ending of a column's name; all others are numbers, or as bright as the images."""
Value = str | int | float


class DropletFileError(BadInput):
    """A file does not hold droplets that can be read; the text names it."""


@dataclass(frozen=True, eq=False)
class StoredDroplets:
    """Droplets as a file has them.

    Parameters
    ----------
    columns : dict of name to (N,) array
        ``frame`` is ``a`` or ``b``.
    provenance : dict
        Where they come from.
    """

    columns: dict[str, NDArray[np.generic]]
    provenance: dict[str, Value]


def write_droplets(
    path: Path,
    exposures: Mapping[str, DropletRows],
    provenance: Mapping[str, Value],
    velocities: Mapping[str, Columns] | None = None,
) -> None:
    """Write the droplets of all exposures of a shot; the file appears whole or not at all, an old one is replaced.

    Parameters
    ----------
    path : Path
        Usually ``*.h5``.
    exposures : mapping of frame name to Droplets or SizedDroplets
        ``a``, and ``b`` where there is one.
    provenance : Mapping[str, str | int | float]
        Where they come from: kept as attributes of the group ``/tomoshadow``.
    velocities : mapping of frame name to columns, optional
        More columns of the same rows, where velocities are measured.
    """
    more = velocities or {}
    tables = [{**exposure.columns(), **more.get(frame, {})} for frame, exposure in exposures.items()]
    frames = [np.full(len(exposure), frame, "S1") for frame, exposure in exposures.items()]
    columns = {FRAME: np.concatenate(frames)} | {
        name: np.concatenate([table[name] for table in tables]) for name in tables[0]
    }
    write_columns(path, columns, provenance)


def unit_of(column: str) -> str:
    """Unit of a column by the ending of its name; 1 for a number, or one as bright as the images."""
    return next((unit for ending, unit in UNITS.items() if column.endswith(ending)), "1")


def write_columns(path: Path, columns: Mapping[str, NDArray[np.generic]], provenance: Mapping[str, Value]) -> None:
    """Write a table of droplets; the file appears whole or not at all, an old one is replaced.

    Parameters
    ----------
    path : Path
        Usually ``*.h5``.
    columns : mapping of name to (N,) array
        ``frame`` among them, as bytes.
    provenance : Mapping[str, str | int | float]
        As of ``write_droplets``.
    """
    with replacing(path, own_part_path(path)) as part, h5py.File(part, "w") as file:
        group = file.create_group(GROUP, track_order=True)
        group.attrs[ROWS] = len(columns[FRAME])
        for name, values in columns.items():
            group.create_dataset(name, data=values).attrs["units"] = unit_of(name)
        if "p_real" in group:
            group["p_real"].attrs["reason"] = P_REAL_UNKNOWN
        if RAW_DIAMETER in columns:
            same = np.array_equal(columns[DIAMETER], columns[RAW_DIAMETER])
            group[DIAMETER].attrs["correction"] = NOT_CORRECTED if same else CORRECTED
        schema = {"schema": SCHEMA, "schema_version": SCHEMA_VERSION}
        file.create_group(PROVENANCE).attrs.update({**provenance, **schema})


def read_droplets(path: str | Path) -> StoredDroplets:
    """Read a file of ``tomoshadow measure``.

    Parameters
    ----------
    path : path
        The file, ``shot_00012_droplets.h5``.

    Returns
    -------
    StoredDroplets
        ``columns`` by name, a row per droplet and exposure, and ``provenance``.

    Raises
    ------
    DropletFileError
        The file is missing, truncated, or not of droplets.
    """
    try:
        with h5py.File(path, "r") as file:
            columns = {name: column[:] for name, column in file[GROUP].items()}
            attributes, rows = dict(file[PROVENANCE].attrs), file[GROUP].attrs.get(ROWS)
    except (OSError, KeyError, ValueError) as error:
        raise DropletFileError(f"{path}: not a readable file of droplets: {error}") from error
    if len(lengths := {len(column) for column in columns.values()}) > 1:
        raise DropletFileError(f"{path}: was changed: its columns have {min(lengths)} to {max(lengths)} rows")
    if rows is not None and lengths != {rows}:
        raise DropletFileError(f"{path}: was changed: it was written with {rows} rows, and has {min(lengths)}")
    columns[FRAME] = columns[FRAME].astype("U1")
    plain = {name: value.item() if isinstance(value, np.generic) else value for name, value in attributes.items()}
    return StoredDroplets(columns, {name: value for name, value in plain.items() if name not in SCHEMA_KEYS})
