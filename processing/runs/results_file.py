"""A results directory: ``settings.json`` and one volume per exposure, ``shot_00012_a.vtkhdf``."""

import json
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Literal

from daq.files.atomic_file import commit, own_part_path, sync
from daq.files.run_directory import RunReader
from processing.calibration.calibration import Calibration
from processing.calibration.calibration_file import file_sha256
from processing.reconstruction.settings import FrozenValue
from processing.reconstruction.volume_file import VolumeFileError

SETTINGS_FILE = "settings.json"
LATER_FIELDS = ("run_created_utc",)
"""Of a provenance; results from before lack it. Two runs may have one name: imports are called as their folders."""
FrameName = Literal["a", "b"]
ExposureKey = tuple[int, FrameName]
"""Shot and exposure."""
Provenance = Mapping[str, str | int | float]


def volume_path(results_dir: Path, shot: int, frame: FrameName) -> Path:
    """Where the volume of one exposure lies."""
    return results_dir / f"shot_{shot:05d}_{frame}.vtkhdf"


def volume_files(results_dir: Path, frame: FrameName | None = None) -> list[Path]:
    """Volumes in a results directory, by shot and frame."""
    return sorted(results_dir.glob(f"shot_*_{frame or '[ab]'}.vtkhdf"))


def provenance_of(
    run: RunReader, calibration: Calibration, calibration_file: Path, settings: FrozenValue, method_version: int
) -> Provenance:
    """Where results of a run come from."""
    return {
        "run": run.header.run_id,
        "run_created_utc": run.header.created_utc,
        "calibration": calibration.id,
        "calibration_file": calibration_file.name,
        "calibration_sha256": file_sha256(calibration_file),
        "settings": settings.model_dump_json(),
        "method_version": method_version,
        "tomoshadow": version("tomoshadow"),
    }


def claim_results(results_dir: Path, provenance: Provenance) -> None:
    """Make the directory, or check that it holds results of the same run, calibration and settings.

    Raises
    ------
    VolumeFileError
        It holds results of something else, or nobody can read of what; they stay as they are.
    """
    results_dir.mkdir(parents=True, exist_ok=True)
    file = results_dir / SETTINGS_FILE
    if not file.exists():
        part = own_part_path(file)  # others may claim it just now
        part.write_text(json.dumps(dict(provenance), indent=2) + "\n", encoding="utf-8")
        sync(part)
        commit(part, file)
    try:
        written = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise VolumeFileError(f"{file}: damaged ({error}); choose another directory, or --overwrite it") from error
    asked = json.loads(json.dumps(dict(provenance)))
    if {**{name: asked[name] for name in LATER_FIELDS if name in asked}, **written} != asked:
        raise VolumeFileError(f"{results_dir}: holds results of another run, calibration or settings; choose another")
