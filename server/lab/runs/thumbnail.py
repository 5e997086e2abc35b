"""A small picture of a shot: exposure A, by the first of the views that have it."""

from functools import lru_cache
from pathlib import Path

from daq.errors import ShotFileError
from daq.files.run_directory import RunReader
from daq.files.run_file import shot_path
from server.lab.errors import NotFound
from server.pictures.pictures import Stretch, preview_jpeg

_WIDTH_PX = 128
_KEPT = 1000
"""Some 3 kB each."""


def thumbnail_of(run_dir: Path, index: int = 0) -> bytes:
    """JPEG of a shot of a run; NotFound if it is not there, cannot be read, or has no exposure A."""
    try:
        return _of(run_dir, index, shot_path(run_dir, index).stat().st_ctime_ns)
    except (OSError, ShotFileError) as error:
        raise NotFound(f"run {run_dir.name} has no picture: shot {index} cannot be read") from error


@lru_cache(_KEPT)
def _of(run_dir: Path, index: int, _changed_ns: int) -> bytes:
    run = RunReader(run_dir)
    for view, frames in run.read_shot(index).views.items():
        if frames.record_a.valid:
            return preview_jpeg(frames.frame_a, run.header.views[view].bits, Stretch.FULL, _WIDTH_PX)
    raise NotFound(f"run {run_dir.name}, shot {index}: no view has exposure A")
