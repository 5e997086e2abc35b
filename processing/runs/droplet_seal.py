"""A seal on files of droplets: one that was edited, or given the name of another shot or run, is refused when read."""

import hashlib
import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from daq.files.run_directory import RunReader, ShotFileError
from daq.files.run_file import RUN_FILE
from processing.analysis.droplets.droplet_file import FRAME, DropletFileError, StoredDroplets, read_droplets
from processing.analysis.droplets.droplet_search import MARGIN_VOXEL
from processing.reconstruction.settings import GridSettings
from processing.runs.results_file import Provenance

SEAL = "seal_sha256"
_NAME = re.compile(r"shot_(\d+)_droplets")
_REMEDY = "copy it back from a backup, or measure the shot again"
Table = Mapping[str, NDArray[Any]]


def sealed(
    droplets: Mapping[str, Table], provenance: Provenance, objects: Mapping[str, Table] | None = None
) -> dict[str, Any]:
    """The provenance of a file, with a hash of all that is written.

    Parameters
    ----------
    droplets, objects : mapping of frame name to columns
        As they are written.
    provenance : Mapping[str, str | int | float]
        Where they come from.
    """
    return {**provenance, SEAL: _hash(droplets, objects or {}, provenance)}


def read_sealed(path: str | Path) -> StoredDroplets:
    """Read a file of droplets that are what was measured, under the name of their shot, in the folder of their run.

    Raises
    ------
    DropletFileError
        They are not, or the file cannot be read. Files of older programs have no seal: of them only names and places
        are looked at.
    """
    path = Path(path)
    stored = read_droplets(path)
    _require_own_name(path, stored.provenance)
    seal = stored.provenance.get(SEAL)
    if seal is None:
        _require_in_box(path, stored)
    elif seal != _hash(by_frame(stored.columns), by_frame(stored.objects), stored.provenance):
        raise DropletFileError(f"{path}: was changed after it had been measured: {_REMEDY}")
    return stored


def _hash(droplets: Mapping[str, Table], objects: Mapping[str, Table], provenance: Mapping[str, Any]) -> str:
    digest = hashlib.sha256()
    for kind, tables in (("droplets", droplets), ("objects", objects)):
        for frame in sorted(tables):
            for part in _bytes_of(tables[frame]):
                digest.update(f"{kind} {frame} ".encode() + part)
    kept = {name: value for name, value in provenance.items() if name != SEAL}
    digest.update(json.dumps(kept, sort_keys=True).encode())
    return digest.hexdigest()


def _bytes_of(table: Table) -> Iterator[bytes]:
    """Column by column; texts do not depend on how many bytes each has in the file."""
    for name in sorted(set(table) - {FRAME}):
        values = np.ascontiguousarray(table[name])
        if values.size:
            text = values.dtype.kind in "SU"
            yield f"{name} {'text' if text else values.dtype.str} ".encode()
            yield "\0".join(values.astype("U").tolist()).encode() if text else values.tobytes()


def by_frame(columns: Table) -> dict[str, Table]:
    """A table for each exposure that has rows."""
    frames = columns.get(FRAME, np.empty(0, "U1")).astype("U1")
    return {
        str(frame): {name: values[frames == frame] for name, values in columns.items()} for frame in np.unique(frames)
    }


def _require_own_name(path: Path, provenance: Mapping[str, Any]) -> None:
    named, shot, run = _NAME.fullmatch(path.stem), provenance.get("shot"), provenance.get("run")
    if named and shot is not None and int(named[1]) != shot:
        raise DropletFileError(f"{path}: was renamed, it holds the droplets of shot {shot}: give it its name back")
    around = _run_around(path)
    if run is not None and around not in (None, run):
        raise DropletFileError(f"{path}: holds droplets of run {run} and lies in run {around}: bring it back")


def _run_around(path: Path) -> str | None:
    """Id of the run in whose results a file lies; None if it lies elsewhere, or nobody can read the run."""
    folders = path.resolve().parents
    if len(folders) < 3 or folders[1].name != "results" or not (folders[2] / RUN_FILE).is_file():
        return None
    try:
        return RunReader(folders[2]).header.run_id
    except ShotFileError:
        return None


def _require_in_box(path: Path, stored: StoredDroplets) -> None:
    """No droplet is found outside of what was searched."""
    said = stored.provenance.get("grid")
    if said is None or "x_mm" not in stored.columns:
        return
    grid = GridSettings.model_validate_json(str(said)).to_grid()
    settings = json.loads(str(stored.provenance.get("settings", "{}")))
    margin_mm = (1 + settings.get("margin_voxel", MARGIN_VOXEL)) * grid.pitch_mm
    for name, span_mm in (("x_mm", grid.x_mm), ("y_mm", grid.y_mm), ("z_mm", grid.z_mm)):
        places = np.asarray(stored.columns[name], np.float64)
        outside = (places < span_mm[0] - margin_mm) | (places > span_mm[-1] + margin_mm)
        if outside.any():
            raise DropletFileError(
                f"{path}: was changed: {int(outside.sum())} droplets have {name} outside of {span_mm[0]:g} to "
                f"{span_mm[-1]:g} mm, where they were looked for: {_REMEDY}"
            )
