"""Droplets of a shot in an HDF5 file: 1-D columns, a row per droplet and exposure; and objects that are none."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol

import h5py
import numpy as np
from numpy.typing import NDArray

from daq.files.atomic_file import own_part_path, replacing
from processing.analysis.droplets.droplet_table import P_REAL_TRIED, Columns, DropletRows
from processing.analysis.droplets.stored_texts import fault_of
from processing.analysis.seal import SEAL, Table, seal_of
from processing.analysis.stored_json import stored_json
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
OBJECTS = "objects"
"""Group of liquid that is no droplet; files of bright particles and of older programs have none."""
_UNITS = {"mm": "mm", "mm2": "mm^2", "um": "um", "px": "px", "m_s": "m/s", "m2_s2": "m^2/s^2", "m_s2": "m/s^2"}
UNITS = MappingProxyType({f"_{ending}": unit for ending, unit in _UNITS.items()})
"""By the ending of a column's name; all others are numbers, or as bright as the images."""
Value = str | int | float


REMEDY = "copy it back from a backup, or measure the shot again"
PLACES = ("x_", "y_", "z_")
"""Names of columns that say where a droplet is begin so."""


class Rows(Protocol):
    """A table of one exposure."""

    def __len__(self) -> int: ...

    def columns(self) -> Columns:
        """Columns by their names, as files have them."""


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
    objects : dict of name to (M,) array
        Columns of liquid that is no droplet; empty where nobody looked for it.
    """

    columns: dict[str, NDArray[np.generic]]
    provenance: dict[str, Value]
    objects: dict[str, NDArray[np.generic]] = field(default_factory=dict)

    @cached_property
    def exposures(self) -> Mapping[str, Mapping[str, Any]]:
        """What was told of each exposure, by its name; empty where the file does not say."""
        told: Mapping[str, Mapping[str, Any]] = stored_json(self.provenance, "exposures")
        return told

    @property
    def name(self) -> str:
        """Run and shot, for people."""
        return f"{self.provenance.get('run', 'a run')}, shot {self.provenance.get('shot', '?')}"


def write_droplets(
    path: Path,
    exposures: Mapping[str, DropletRows],
    provenance: Mapping[str, Value],
    *,
    velocities: Mapping[str, Columns] | None = None,
    objects: Mapping[str, Rows] | None = None,
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
    objects : mapping of frame name to LiquidObjects, optional
        Liquid that is no droplet.
    """
    more = velocities or {}
    droplets = {frame: {**exposure.columns(), **more.get(frame, {})} for frame, exposure in exposures.items()}
    others = {frame: exposure.columns() for frame, exposure in (objects or {}).items()}
    write_columns(path, joined(droplets), provenance, joined(others) if others else {})


def joined(exposures: Mapping[str, Columns]) -> Columns:
    """Columns of all exposures, one below the other."""
    tables = list(exposures.values())
    frames = [np.full(len(next(iter(table.values()))), frame, "S1") for frame, table in exposures.items()]
    return {FRAME: np.concatenate(frames)} | {
        name: np.concatenate([table[name] for table in tables]) for name in tables[0]
    }


def unit_of(column: str) -> str:
    """Unit of a column by the ending of its name; 1 for a number, or one as bright as the images."""
    return next((unit for ending, unit in UNITS.items() if column.endswith(ending)), "1")


def write_columns(
    path: Path,
    columns: Mapping[str, NDArray[np.generic]],
    provenance: Mapping[str, Value],
    objects: Mapping[str, NDArray[np.generic]] = MappingProxyType({}),
) -> None:
    """Write a table of droplets; the file appears whole or not at all, an old one is replaced.

    It is sealed with a hash of all that is written, by which ``read_droplets`` knows a file that was edited.

    Parameters
    ----------
    path : Path
        Usually ``*.h5``.
    columns : mapping of name to (N,) array
        ``frame`` among them, as bytes.
    provenance : Mapping[str, str | int | float]
        As of ``write_droplets``.
    objects : mapping of name to (M,) array
        Likewise, of liquid that is no droplet; no group of them where it is empty.
    """
    with replacing(path, own_part_path(path)) as part, h5py.File(part, "w") as file:
        group = _write_table(file, GROUP, columns)
        if objects:
            _write_table(file, OBJECTS, objects)
        if "p_real" in group:
            group["p_real"].attrs["reason"] = P_REAL_TRIED
        if RAW_DIAMETER in columns:
            same = np.array_equal(columns[DIAMETER], columns[RAW_DIAMETER])
            group[DIAMETER].attrs["correction"] = NOT_CORRECTED if same else CORRECTED
        schema = {"schema": SCHEMA, "schema_version": SCHEMA_VERSION}
        sealed = {**provenance, SEAL: _seal(columns, objects, provenance)}
        file.create_group(PROVENANCE).attrs.update({**sealed, **schema})


def _seal(columns: Table, objects: Table, provenance: Mapping[str, Value]) -> str:
    return seal_of({GROUP: _by_frame(columns), OBJECTS: _by_frame(objects)}, provenance)


def _by_frame(columns: Table) -> dict[str, Table]:
    """A table for each exposure that has rows."""
    frames = columns.get(FRAME, np.empty(0, "U1")).astype("U1")
    others = {name: values for name, values in columns.items() if name != FRAME}
    return {
        str(frame): {name: values[frames == frame] for name, values in others.items()} for frame in np.unique(frames)
    }


def _write_table(file: h5py.File, name: str, columns: Mapping[str, NDArray[np.generic]]) -> h5py.Group:
    group = file.create_group(name, track_order=True)
    group.attrs[ROWS] = len(columns[FRAME])
    for column, values in columns.items():
        group.create_dataset(column, data=values).attrs["units"] = unit_of(column)
    return group


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
        The file is missing, truncated, not of droplets, or was edited after it had been measured. Files of older
        programs have no seal: edited ones are not known.
    """
    try:
        with h5py.File(path, "r") as file:
            columns = _placed(path, _read_table(path, file[GROUP]))
            objects = _read_table(path, file[OBJECTS]) if OBJECTS in file else {}
            attributes = dict(file[PROVENANCE].attrs)
    except (OSError, KeyError, ValueError) as error:
        raise DropletFileError(f"{path}: not a readable file of droplets: {error}") from error
    plain = {name: value.item() if isinstance(value, np.generic) else value for name, value in attributes.items()}
    provenance = {name: value for name, value in plain.items() if name not in SCHEMA_KEYS}
    if fault := fault_of(provenance):
        raise DropletFileError(f"{path}: was changed: {fault}")
    if provenance.get(SEAL) not in (None, _seal(columns, objects, provenance)):
        raise DropletFileError(f"{path}: was changed after it had been measured: {REMEDY}")
    return StoredDroplets(columns, provenance, objects)


def _placed(path: str | Path, columns: Columns) -> Columns:
    """The same, if every droplet is somewhere."""
    for name in (name for name in columns if name.startswith(PLACES)):
        if not np.isfinite(columns[name]).all():
            raise DropletFileError(f"{path}: was changed: {name} of a droplet is not finite")
    return columns


def _read_table(path: str | Path, group: h5py.Group) -> Columns:
    columns = {name: column[:] for name, column in group.items()}
    rows = group.attrs.get(ROWS)
    if len(lengths := {len(column) for column in columns.values()}) > 1:
        raise DropletFileError(f"{path}: was changed: its columns have {min(lengths)} to {max(lengths)} rows")
    if rows is not None and lengths != {rows}:
        raise DropletFileError(f"{path}: was changed: it was written with {rows} rows, and has {min(lengths)}")
    return {name: column.astype("U") if column.dtype.kind == "S" else column for name, column in columns.items()}
