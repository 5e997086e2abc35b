"""A small picture of a run: exposure A of its first shot, by the first of its views."""

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


def thumbnail_of(run_dir: Path) -> bytes:
    """JPEG; NotFound if the first shot is not there, or cannot be read."""
    try:
        return _of(run_dir, shot_path(run_dir, 0).stat().st_ctime_ns)
    except (OSError, ShotFileError) as error:
        raise NotFound(f"run {run_dir.name} has no picture: its first shot cannot be read") from error


@lru_cache(_KEPT)
def _of(run_dir: Path, _changed_ns: int) -> bytes:
    run = RunReader(run_dir)
    views = run.read_shot(0).views.items()
    view, image = next((view, frames.frame_a) for view, frames in views if frames.frame_a is not None)
    return preview_jpeg(image, run.header.views[view].bits, Stretch.FULL, _WIDTH_PX)
