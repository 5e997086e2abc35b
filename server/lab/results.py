"""Results of a run on disk: sets of volumes or droplets by settings and calibration, and previews of the volumes."""

import json
import re
import threading
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from daq.frozen_model import FrozenModel
from processing.calibration.verdict import BELONGING
from processing.errors import BadInput
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.settings import ReconstructionSettings
from processing.reconstruction.slab_volume import SlabVolume
from processing.reconstruction.volume_file import VolumeFileError, open_volume, write_slabs
from processing.reconstruction.volume_part import PartError, RangesMm
from processing.runs.results_file import SETTINGS_FILE, Provenance, volume_files
from processing.runs.run_around import of_another_run
from processing.runs.volumes.volume_parts import Recipe, VolumePart, VolumeParts, stored_part
from processing.volume import VoxelGrid
from server.lab.calibrations import CalibrationStore
from server.lab.errors import Conflict, Damaged, NotFound, Unprocessable
from server.pictures.previews import (
    GrowingPreview,
    VolumePreview,
    is_preview_of,
    load_preview,
    load_provenance,
    preview_files,
    preview_of_slabs,
    preview_path,
    save_preview,
    volume_of,
)
from server.pictures.surfaces import BLUE, RED, Colour, surface_glb

VOLUME_NAME = re.compile(r"shot_(?P<shot>[0-9]{5,7})_(?P<frame>[ab])")
"""Name of a volume, without the ending of its file."""
DROPLETS_NAME = re.compile(r"shot_(?P<shot>[0-9]{5,7})_droplets")
"""Name of a file of droplets, without its ending."""
_MAKING = threading.Lock()  # a full volume takes seconds: who waits for a preview does not make it again


class VolumeSummary(FrozenModel):
    """One volume of a result set."""

    name: Annotated[str, Field(description="of its file, without the ending")]
    shot: Annotated[int, Field(description="position in the run, from 0")]
    frame: Annotated[str, Field(description="exposure, a or b")]
    size_bytes: Annotated[int, Field(description="of its file; 0 while only its preview is kept")]


class DropletsSummary(FrozenModel):
    """The droplets of one shot of a result set."""

    name: Annotated[str, Field(description="of their file, without the ending")]
    shot: Annotated[int, Field(description="position in the run, from 0")]
    size_bytes: Annotated[int, Field(description="of their file")]


class ResultSet(FrozenModel):
    """Volumes, or droplets, that were made with the same settings and calibration."""

    id: Annotated[str, Field(description="name of the directory; stands for settings and calibration")]
    provenance: Annotated[
        dict[str, Any], Field(description="what the volumes were made of; empty if it cannot be read")
    ]
    volumes: Annotated[tuple[VolumeSummary, ...], Field(description="those that are there, by shot and exposure")]
    droplets: Annotated[tuple[DropletsSummary, ...], Field(description="those that are there, by shot")] = ()
    problem: Annotated[str | None, Field(description="why the provenance cannot be read; null if it can")] = None


def result_sets(run_dir: Path) -> list[ResultSet]:
    """All result sets of a run, newest first; one that cannot be read says so, and hides no other."""
    records = sorted(_dated(run_dir.glob("results/*/settings.json")), reverse=True)
    return [_result_set(record) for _, record in records]


def result_calibration(run_dir: Path, results_id: str) -> str | None:
    """Hash of the calibration that results were made with; None where there are none, or nobody can read it."""
    try:
        written = json.loads((run_dir / "results" / results_id / "settings.json").read_text())
        return str(written["calibration"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _dated(records: Iterator[Path]) -> Iterator[tuple[int, Path]]:
    for record in records:
        try:
            yield record.stat().st_mtime_ns, record
        except FileNotFoundError:
            continue  # taken away meanwhile


def volume_file(run_dir: Path, results_id: str, name: str) -> Path:
    """File of a volume, which is made when somebody asks for it; NotFound if there is not even a preview."""
    path = run_dir / "results" / results_id / f"{name}.vtkhdf"
    if not is_kept(path):
        raise NotFound(f"run {run_dir.name} has no volume {results_id}/{name}")
    return path


def preview_of(volume: Path) -> VolumePreview:
    """Preview of a volume; made now if the volume was written by other hands, or its preview is damaged.

    Raises
    ------
    Damaged
        The volume cannot be read, or is that of another shot, exposure, run, or of other settings; the text names it.
    Conflict
        It was made of another run than now lies around it.
    """
    stored = preview_path(volume)
    try:
        with _MAKING:
            if volume.is_file() and not is_preview_of(stored, volume):
                _write_preview(volume)
            try:
                preview = _load(stored, stored.stat().st_ctime_ns)
            except (OSError, ValueError, KeyError, zipfile.BadZipFile):
                _write_preview(volume)
                preview = _load(stored, stored.stat().st_ctime_ns)
        _require_own_place(volume, load_provenance(stored))
        return preview
    except (VolumeFileError, OSError, ValueError) as error:
        if not is_kept(volume):
            raise NotFound(f"{volume.name} is not there any more") from error
        raise Damaged(f"{volume.name} cannot be shown: {error}") from error


def _write_preview(volume: Path) -> None:
    """Read a volume and leave its preview beside it."""
    with open_volume(volume) as stored:
        preview = preview_of_slabs(stored.slabs(), stored.grid)
        save_preview(preview_path(volume), preview, stored.provenance)


def keep_preview(file: Path, volume: SlabVolume, grid: VoxelGrid, provenance: Provenance) -> None:
    """Keep of a volume what is looked at, and what it takes to make it again."""
    save_preview(preview_path(file), preview_of_slabs(volume.slabs, grid, volume.unit), provenance)


def keep_volume(file: Path, volume: SlabVolume, grid: VoxelGrid, provenance: Provenance) -> None:
    """Keep the whole volume, and its preview."""
    growing = GrowingPreview(grid, volume.unit)
    write_slabs(file, replace(volume, slabs=growing.watching(volume.slabs)), grid, provenance)
    save_preview(preview_path(file), growing.preview(), provenance)


def is_kept(volume: Path) -> bool:
    """Whether a volume is there, or its preview."""
    return volume.is_file() or preview_path(volume).is_file()


def remaking(volume: Path) -> dict[str, Any]:
    """Arguments of a task that makes a volume again of which a preview is kept, but for its calibration's file.

    Raises
    ------
    Damaged
        Nobody can read any more how it was made.
    """
    try:
        made_by = load_provenance(preview_path(volume))
        _require_own_place(volume, made_by)
        return {
            "run_dir": str(volume.parents[2]),
            "shot": int(made_by["shot"]),
            "calibration_file": str(made_by["calibration_file"]),
            "results_dir": str(volume.parent),
            "settings": json.loads(made_by["settings"]),
            BELONGING: json.loads(made_by.get(BELONGING, "null")),
            "keep": "volume",
        }
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise Damaged(f"{volume.name} cannot be made again: its preview does not say how ({error})") from error


def _require_own_name(volume: Path, made_by: Provenance) -> None:
    shot, frame = int(made_by["shot"]), made_by.get("frame", volume.stem[-1])
    if (name := VOLUME_NAME.fullmatch(volume.stem)) and (int(name["shot"]), name["frame"]) != (shot, frame):
        raise ValueError(f"it was renamed, and is of shot {shot}, exposure {frame}")


def _require_own_place(volume: Path, made_by: Provenance) -> None:
    """What says nothing of itself may be anything."""
    if "shot" in made_by:
        _require_own_name(volume, made_by)
    record = volume.parent / SETTINGS_FILE
    told = json.loads(record.read_text(encoding="utf-8")) if record.is_file() else {}
    for name in ("run", "calibration", "settings"):
        if name in told and made_by.get(name, told[name]) != told[name]:
            raise ValueError(f"it was brought from elsewhere, and is of {name} {made_by[name]}, not {told[name]}")
    if another := of_another_run(volume, made_by):
        raise Conflict(f"{volume.name}: is {another}; reconstruct the shot anew")


def part_of(
    parts: VolumeParts,
    volume: Path,
    calibrations: CalibrationStore,
    ranges_mm: RangesMm,
    method: ReconstructionMethod | None = None,
) -> VolumePart:
    """A slice or a region of a volume at full resolution, by its own method or by another line-of-sight method.

    Raises
    ------
    Damaged
        Nobody can read any more how the volume was made.
    Conflict
        It cannot be made from the images: of an iterative method, before the whole volume is stored; or where run or
        calibration are not the same any more.
    Unprocessable
        There is no such part, or it is too large.
    """
    recipe = _recipe(volume, calibrations)
    chosen = method or recipe.settings.method
    try:
        if not chosen.iterative:
            return parts.seen(recipe, ranges_mm, chosen)
        if chosen is recipe.settings.method and volume.is_file():
            return stored_part(volume, ranges_mm, chosen)
    except PartError as error:
        raise Unprocessable(str(error)) from error
    except (BadInput, FileNotFoundError) as error:
        raise Conflict(f"{volume.name}: {error}") from error
    raise Conflict(
        f"{volume.name}: {chosen.value} computes the whole volume, no part of it alone; download volume.vtkhdf of a "
        "result by this method, then its parts can be seen; or ask for one by method=mlos"
    )


def _recipe(volume: Path, calibrations: CalibrationStore) -> Recipe:
    preview_of(volume)  # made of a volume that other hands have written, with what that says of itself
    again = remaking(volume)
    return Recipe(
        run_dir=Path(again["run_dir"]),
        shot=again["shot"],
        frame="a" if volume.stem.endswith("_a") else "b",
        calibration_file=calibrations.path(Path(again["calibration_file"]).stem),
        settings=ReconstructionSettings.model_validate(again["settings"]),
        made_by=load_provenance(preview_path(volume)),
    )


def surface_of(volume: Path, level: float) -> bytes:
    """Iso-surface of a volume as it is now, binary glTF; blue of exposure A, red of B."""
    preview_of(volume)
    stored = preview_path(volume)
    colour = RED if volume.stem.endswith("_b") else BLUE
    return _surface(stored, stored.stat().st_ctime_ns, level, colour)


@lru_cache(maxsize=16)
def _surface(stored: Path, changed_ns: int, level: float, colour: Colour) -> bytes:
    return surface_glb(_load(stored, changed_ns), level, colour)


@lru_cache(maxsize=8)
def _load(stored: Path, _changed_ns: int) -> VolumePreview:
    return load_preview(stored)


def _result_set(record: Path) -> ResultSet:
    volumes, droplets = tuple(volume_summaries(record.parent)), tuple(droplet_summaries(record.parent))
    made = ResultSet(id=record.parent.name, provenance={}, volumes=volumes, droplets=droplets)
    try:
        return made.model_copy(update={"provenance": json.loads(record.read_text())})
    except (OSError, ValueError) as error:
        return made.model_copy(update={"problem": f"{record}: cannot be read: {error}"})


def droplet_summaries(results_dir: Path) -> Iterator[DropletsSummary]:
    """Files of droplets in a result set, by shot."""
    for path in sorted(results_dir.glob("shot_*_droplets.h5")):
        if (name := DROPLETS_NAME.fullmatch(path.stem)) and path.is_file():
            yield DropletsSummary(name=path.stem, shot=int(name["shot"]), size_bytes=path.stat().st_size)


def volume_summaries(results_dir: Path) -> Iterator[VolumeSummary]:
    """Volumes in a result set, by shot and exposure."""
    previewed = map(volume_of, preview_files(results_dir))
    for path in sorted({*volume_files(results_dir), *previewed}):
        if name := VOLUME_NAME.fullmatch(path.stem):
            size_bytes = path.stat().st_size if path.is_file() else 0
            yield VolumeSummary(name=path.stem, shot=int(name["shot"]), frame=name["frame"], size_bytes=size_bytes)
