"""Results of a run on disk: sets of volumes by settings and calibration, and the previews of the volumes."""

import json
import threading
from functools import lru_cache
from pathlib import Path
from typing import Any

from daq.frozen_model import FrozenModel
from processing.reconstruction.volume_file import open_volume
from processing.runs.results_file import volume_files
from server.lab.errors import NotFound
from server.pictures.previews import VolumePreview, load_preview, make_preview, preview_path, save_preview
from server.pictures.surfaces import surface_glb

_MAKING = threading.Lock()  # a full volume takes seconds: who waits for a preview does not make it again


class VolumeSummary(FrozenModel):
    """One volume of a result set."""

    name: str
    shot: int
    frame: str
    size_bytes: int


class ResultSet(FrozenModel):
    """Volumes that were made with the same settings and calibration."""

    id: str
    provenance: dict[str, Any]
    volumes: tuple[VolumeSummary, ...]


def result_sets(run_dir: Path) -> list[ResultSet]:
    """All result sets of a run, newest first."""
    records = sorted(run_dir.glob("results/*/settings.json"), key=lambda path: path.stat().st_mtime_ns, reverse=True)
    return [_result_set(record) for record in records]


def volume_file(run_dir: Path, results_id: str, name: str) -> Path:
    """File of a volume; NotFound if there is none."""
    path = run_dir / "results" / results_id / f"{name}.vtkhdf"
    if not path.is_file():
        raise NotFound(f"run {run_dir.name} has no volume {results_id}/{name}")
    return path


def preview_of(volume: Path) -> VolumePreview:
    """Preview of a volume; made now if the volume was written by other hands."""
    stored = preview_path(volume)
    with _MAKING:
        if not stored.is_file() or stored.stat().st_mtime_ns < volume.stat().st_mtime_ns:
            write_preview(volume)
    return _load(stored, stored.stat().st_mtime_ns)


def write_preview(volume: Path) -> None:
    """Read a volume and leave its preview beside it."""
    with open_volume(volume) as stored:
        save_preview(preview_path(volume), make_preview(stored, stored.grid))


@lru_cache(maxsize=16)
def surface_of(volume: Path, level: float) -> bytes:
    """Iso-surface of a volume, binary glTF."""
    return surface_glb(preview_of(volume), level)


@lru_cache(maxsize=8)
def _load(stored: Path, _mtime_ns: int) -> VolumePreview:
    return load_preview(stored)


def _result_set(record: Path) -> ResultSet:
    volumes = tuple(_volume_summary(path) for path in volume_files(record.parent))
    return ResultSet(id=record.parent.name, provenance=json.loads(record.read_text()), volumes=volumes)


def _volume_summary(path: Path) -> VolumeSummary:
    _, shot, frame = path.stem.split("_")
    return VolumeSummary(name=path.stem, shot=int(shot), frame=frame, size_bytes=path.stat().st_size)
