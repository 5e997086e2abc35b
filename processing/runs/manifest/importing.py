"""Images from elsewhere become a run and a calibration set. All or nothing."""

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypedDict

import cv2

from daq.files.run_directory import ImageKey
from processing.calibration.errors import CalibrationError
from processing.calibration.sets.calibration_set import SET_FILE, write_set_file
from processing.calibration.sets.points_table import read_table
from processing.calibration.sets.set_record import CalibrationEntry, PlaneEntry, PointsEntry
from processing.image_file import GreyImage
from processing.runs.manifest.import_manifest import ManifestFile, named_files, read_manifest
from processing.runs.manifest.run_import import Done, ExposureReader, read_source, write_run
from processing.runs.manifest.shot_sources import ImageSource, ShotSource, shot_sources
from processing.runs.overwriting import replacing, require_free
from processing.runs.toml_lines import Key

CALIBRATION_FOLDER, RUN_FOLDER = "calibration", "run"
_MADE_WITH = (f"{CALIBRATION_FOLDER}/{SET_FILE}", f"{RUN_FOLDER}/run.h5")


class Imported(TypedDict):
    """What was written; paths are None where the manifest has no such part."""

    calibration: str | None
    run: str | None
    cameras: list[str]
    planes: int
    shots: int
    notes: list[str]


def import_manifest(
    manifest_path: Path, out_dir: Path, *, overwrite: bool = False, done: Done = lambda _shot, _of: None
) -> Imported:
    """Import everything that a manifest names.

    Parameters
    ----------
    manifest_path : Path
        TOML, see ``processing.runs.manifest.import_manifest``.
    out_dir : Path
        Receives ``calibration/`` (a calibration set) and ``run/`` (a run).
    overwrite : bool
        Whether an earlier import there may be replaced.
    done : callable
        Told how many shots of how many are written, after each.

    Raises
    ------
    ManifestError
        Manifest or images are wrong; nothing is written.
    OutputExistsError
        ``out_dir`` is there, and may not be replaced.
    """
    source, out_dir = read_manifest(manifest_path), Path(out_dir)
    require_free(out_dir, overwrite=overwrite, made_with=_MADE_WITH)
    run = source.manifest.run
    shots = shot_sources(source, run) if run else []
    _check_files(source, shots)
    _check_once(source, shots)
    _check_tables(source)
    with replacing(out_dir) as part:
        part.mkdir()
        notes = _write_parts(source, shots, part, done)
    return _summary(source, shots, out_dir, notes)


def _check_files(source: ManifestFile, shots: Sequence[ShotSource]) -> None:
    of_run = [(image.key, image.file) for shot in shots for images in shot.frames for image in images.values()]
    named = [*named_files(source.manifest), *of_run]
    missing = [(key, file) for key, file in named if not source.resolve(file).is_file()]
    if missing:
        key, file = missing[0]
        others = f" (and {len(missing) - 1} more)" if len(missing) > 1 else ""
        raise source.error(key, f"{source.resolve(file)} does not exist{others}")


def _check_once(source: ManifestFile, shots: Sequence[ShotSource]) -> None:
    """Refuse an image of a shot that is named again, for another camera, exposure, or as a background."""
    of_shots: set[tuple[Path, int | None]] = set()
    for shot in sorted(shots, key=lambda one: one.image_key != ImageKey.SAMPLE):
        for image in (image for images in shot.frames for image in images.values()):
            place = source.resolve(image.file).resolve(), image.page
            if place in of_shots:
                page = "" if image.page is None else f", page {image.page},"
                raise source.error(image.key, f"{place[0]}{page} is named twice; it is one exposure of one camera")
            if shot.image_key == ImageKey.SAMPLE:
                of_shots.add(place)


def _check_tables(source: ManifestFile) -> None:
    """Refuse tables that calibration could not read; all of them are named at once."""
    problems: list[tuple[Key, str]] = []
    for number, entry in enumerate(source.manifest.calibration.points if source.manifest.calibration else ()):
        try:
            read_table(source.resolve(entry.file), entry.columns)
        except CalibrationError as error:
            problems.append((("calibration", "points", number, "file"), str(error)))
    if problems:
        raise source.error(problems[0][0], "; ".join(text for _, text in problems))


def _write_parts(source: ManifestFile, shots: Sequence[ShotSource], part: Path, done: Done) -> tuple[str, ...]:
    manifest = source.manifest
    reader = ExposureReader(source, manifest.run, shots[0]) if manifest.run else None
    if manifest.calibration is not None:
        sizes = {camera: (one.shape[1], one.shape[0]) for camera, one in reader.formats.items()} if reader else {}
        _write_calibration(source, manifest.calibration, sizes, part / CALIBRATION_FOLDER)
    if manifest.run is not None and reader is not None:
        return write_run(source, manifest.run, shots, reader, part / RUN_FOLDER, done)
    return ()


def _summary(source: ManifestFile, shots: Sequence[ShotSource], out_dir: Path, notes: Sequence[str]) -> Imported:
    calibration, run = source.manifest.calibration, source.manifest.run
    cameras = [*(calibration.cameras if calibration else ()), *(shots[0].frames[0] if shots else ())]
    return Imported(
        calibration=str(out_dir / CALIBRATION_FOLDER) if calibration else None,
        run=str(out_dir / RUN_FOLDER) if run else None,
        cameras=list(dict.fromkeys(cameras)),
        planes=len(calibration.plane) if calibration else 0,
        shots=sum(shot.image_key == ImageKey.SAMPLE for shot in shots),
        notes=list(notes),
    )


def _write_calibration(
    source: ManifestFile, calibration: CalibrationEntry, sizes: Mapping[str, tuple[int, int]], folder: Path
) -> None:
    """Copy images and tables as they are, and say in ``set.json`` what they are."""
    folder.mkdir()
    planes = tuple(
        plane.model_copy(update={"images": _copy_plane(source, number, plane, folder), "page": None})
        for number, plane in enumerate(calibration.plane)
    )
    points = tuple(
        _copy_points(source, number, entry, sizes, folder) for number, entry in enumerate(calibration.points)
    )
    write_set_file(folder, source.path.stem, calibration.model_copy(update={"plane": planes, "points": points}))


def _copy_plane(source: ManifestFile, number: int, plane: PlaneEntry, folder: Path) -> dict[str, str]:
    copies = {}
    for camera, file in plane.images.items():
        image = ImageSource(("calibration", "plane", number, "images", camera), file, plane.page)
        pixels = read_source(source, image)
        place = f"images/{number:03d}"
        copies[camera] = (
            _copy(source.resolve(file), folder, place) if plane.page is None else _save(image, pixels, folder, place)
        )
    return copies


def _copy_points(
    source: ManifestFile, number: int, entry: PointsEntry, sizes: Mapping[str, tuple[int, int]], folder: Path
) -> PointsEntry:
    place = f"points/{number:03d}"
    copied: dict[str, object] = {"file": _copy(source.resolve(entry.file), folder, place)}
    if entry.image is not None:
        read_source(source, ImageSource(("calibration", "points", number, "image"), entry.image))
        copied["image"] = _copy(source.resolve(entry.image), folder, place)
    elif entry.image_size_px is None:
        copied["image_size_px"] = sizes.get(entry.camera)
        if entry.v_axis == "up" and entry.camera not in sizes:
            key: Key = ("calibration", "points", number, "v_axis")
            raise source.error(key, "counted from the bottom of an image of which size? Say image_size_px")
    return entry.model_copy(update=copied)


def _save(image: ImageSource, pixels: GreyImage, folder: Path, place: str) -> str:
    """Keep one image of a stack as a file of its own."""
    file = Path(image.file)
    target = folder / place / f"{file.stem}_page{image.page}.tif"
    target.parent.mkdir(parents=True, exist_ok=True)
    if not cv2.imwrite(str(target), pixels):
        raise OSError(f"{target}: cannot be written")
    return str(target.relative_to(folder))


def _copy(file: Path, folder: Path, place: str) -> str:
    target = folder / place / file.name
    target.parent.mkdir(parents=True, exist_ok=True)
    if not target.exists():
        shutil.copyfile(file, target)
    return str(target.relative_to(folder))
