"""Does what lies in the results of a run belong to it? Two runs may have one name: when they began tells them apart."""

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from daq.files.header import RunHeader
from daq.files.run_directory import RunReader, ShotFileError
from daq.files.run_file import RUN_FILE


def of_another_run(file: Path, provenance: Mapping[str, Any]) -> str:
    """Of which run a file is, where another one lies around it; empty where it is that run, or nobody can tell."""
    around = run_around(file)
    if around is None:
        return ""
    run, began = provenance.get("run", around.run_id), provenance.get("run_created_utc") or around.created_utc
    if run != around.run_id:
        return f"of run {run} and lies in run {around.run_id}"
    if around.created_utc not in ("", began):
        return f"of run {run} that began at {began} and lies in another one, which began at {around.created_utc}"
    return ""


def run_around(file: Path) -> RunHeader | None:
    """The run in whose results a file lies; None if it lies elsewhere, or nobody can read the run."""
    run_dir = directory_around(file)
    return _header(run_dir, (run_dir / RUN_FILE).stat().st_ctime_ns) if run_dir else None


def directory_around(file: Path) -> Path | None:
    """Directory of that run, whether anybody can read it or not."""
    folders = file.resolve().parents
    is_around = len(folders) > 2 and folders[1].name == "results" and (folders[2] / RUN_FILE).is_file()
    return folders[2] if is_around else None


@lru_cache(maxsize=64)
def _header(run_dir: Path, _changed_ns: int) -> RunHeader | None:
    try:
        return RunReader(run_dir).header
    except ShotFileError:
        return None
