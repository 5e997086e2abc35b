"""Files of droplets under the name of their shot and in the folder of their run: one that was moved is refused."""

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from daq.files.run_directory import RunReader, ShotFileError
from daq.files.run_file import RUN_FILE
from processing.analysis.droplets.droplet_file import REMEDY, DropletFileError, StoredDroplets, read_droplets
from processing.analysis.droplets.droplet_search import MARGIN_VOXEL
from processing.analysis.seal import SEAL
from processing.reconstruction.settings import GridSettings

_NAME = re.compile(r"shot_(\d+)_droplets")


def read_in_place(path: str | Path) -> StoredDroplets:
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
    if SEAL not in stored.provenance:
        _require_in_box(path, stored)
    return stored


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
                f"{span_mm[-1]:g} mm, where they were looked for: {REMEDY}"
            )
