"""A shot that somebody looks at: read once for all its pictures, and told what is wrong with it."""

from functools import lru_cache
from pathlib import Path

from daq.counted import counted
from daq.files.run_directory import RunReader, Shot, ShotFileError
from daq.files.run_file import shot_path
from daq.run.shots.shot_check import check_exposures
from server.lab.errors import NotFound

_KEPT = 2
"""Of the paper's rig one takes 32 MB."""


def shot_of(run: RunReader, index: int) -> Shot:
    """One shot of a run.

    Raises
    ------
    NotFound
        The run has no such shot, or was deleted meanwhile.
    ShotFileError
        It cannot be read.
    """
    try:
        return _shot(run, index)
    except (ShotFileError, OSError) as error:
        if run.run_dir.is_dir():
            raise
        raise NotFound(f"there is no run {run.run_dir.name!r}: it was deleted") from error


def _shot(run: RunReader, index: int) -> Shot:
    if index >= run.shot_count:
        raise NotFound(f"run {run.run_dir.name} has {counted(run.shot_count, 'shot')}, not {index}")
    path = shot_path(run.run_dir, index)
    return _read(run.run_dir, index, path.stat().st_mtime_ns) if path.is_file() else run.read_shot(index)


def fault_of(shot: Shot) -> str:
    """Why a shot is invalid; empty where it is valid."""
    if shot.valid:
        return ""
    return str(check_exposures(shot.views)) or "another pulse train was fired than the one asked for"


@lru_cache(_KEPT)
def _read(run_dir: Path, index: int, _changed_ns: int) -> Shot:
    return RunReader(run_dir).read_shot(index)
