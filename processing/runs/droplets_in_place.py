"""Files of droplets under the name of their shot and in the folder of their run: one that was moved is refused."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from processing.analysis.droplets.droplet_file import REMEDY, DropletFileError, StoredDroplets, read_droplets
from processing.analysis.droplets.droplet_search import MARGIN_VOXEL
from processing.analysis.seal import SEAL
from processing.analysis.stored_json import stored_json
from processing.count import counted
from processing.reconstruction.settings import GridSettings
from processing.runs.run_around import of_another_run

_NAME = re.compile(r"shot_(\d+)_droplets")
NO_SPRAY = "has droplets of images, in 2-D: they have no place in a spray; measure --json tells their means"


def read_in_place(path: str | Path) -> StoredDroplets:
    """Read a file of droplets in space that are what was measured, under the name of their shot, in their run.

    Raises
    ------
    DropletFileError
        They are not, or the file cannot be read. Files of older programs have no seal: of them only names and places
        are looked at.
    """
    path = Path(path)
    stored = read_droplets(path)
    _require_own_name(path, stored.provenance)
    if "um_per_px" in stored.provenance:
        raise DropletFileError(f"{path}: {NO_SPRAY}")
    if SEAL not in stored.provenance:
        _require_in_box(path, stored)
    return stored


def _require_own_name(path: Path, provenance: Mapping[str, Any]) -> None:
    named, shot = _NAME.fullmatch(path.stem), provenance.get("shot")
    if named and shot is not None and int(named[1]) != shot:
        raise DropletFileError(f"{path}: was renamed, it holds the droplets of shot {shot}: give it its name back")
    if another := of_another_run(path, provenance):
        raise DropletFileError(f"{path}: holds droplets {another}: bring it back")


def _require_in_box(path: Path, stored: StoredDroplets) -> None:
    """No droplet is found outside of what was searched."""
    said = stored.provenance.get("grid")
    if said is None or "x_mm" not in stored.columns:
        return
    grid = GridSettings.model_validate_json(str(said)).to_grid()
    settings = stored_json(stored.provenance, "settings")
    margin_mm = (1 + settings.get("margin_voxel", MARGIN_VOXEL)) * grid.pitch_mm
    for name, span_mm in (("x_mm", grid.x_mm), ("y_mm", grid.y_mm), ("z_mm", grid.z_mm)):
        places = np.asarray(stored.columns[name], np.float64)
        outside = (places < span_mm[0] - margin_mm) | (places > span_mm[-1] + margin_mm)
        if outside.any():
            raise DropletFileError(
                f"{path}: was changed: {counted(int(outside.sum()), 'droplet')} have {name} outside of "
                f"{span_mm[0]:g} to {span_mm[-1]:g} mm, where they were looked for: {REMEDY}"
            )
