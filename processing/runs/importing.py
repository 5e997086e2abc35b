"""Images from elsewhere become a run and a calibration set. All or nothing; nothing is ever overwritten."""

import hashlib
import os
import shutil
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from daq.files.run_directory import DoubleFrame, ExposureRecord, ImageKey, RunHeader, RunWriter, Shot, ViewFormat
from processing.calibration.sets.calibration_set import write_set_file
from processing.calibration.sets.set_record import CalibrationEntry, PlaneEntry, PointsEntry
from processing.image_file import GreyImage, ImageFileError, read_image
from processing.runs.import_manifest import ManifestError, ManifestFile, RunEntry, named_files, read_manifest
from processing.runs.toml_lines import Key

CALIBRATION_FOLDER, RUN_FOLDER = "calibration", "run"

_KINDS = (("shot", ImageKey.SAMPLE), ("background", ImageKey.BACKGROUND), ("dark", ImageKey.DARK))


class Imported(TypedDict):
    """What was written; paths are None where the manifest has no such part."""

    calibration: str | None
    run: str | None
    cameras: list[str]
    planes: int
    shots: int


def import_manifest(manifest_path: Path, out_dir: Path) -> Imported:
    """Import everything that a manifest names.

    Parameters
    ----------
    manifest_path : Path
        TOML, see ``processing.runs.import_manifest``.
    out_dir : Path
        Must not exist; receives ``calibration/`` (a calibration set) and ``run/`` (a run).

    Raises
    ------
    ManifestError
        Manifest or images are wrong, or ``out_dir`` exists; nothing is written.
    """
    source, out_dir = read_manifest(manifest_path), Path(out_dir)
    if out_dir.exists():
        raise ManifestError(f"{out_dir}: exists; an import never overwrites")
    _check_files(source)
    part = out_dir.with_name(f".{out_dir.name}.{os.getpid()}.part")
    try:
        part.mkdir(parents=True)
        _write_parts(source, part, out_dir)
        part.rename(out_dir)
    except BaseException:
        shutil.rmtree(part, ignore_errors=True)
        raise
    return _summary(source, out_dir)


def _check_files(source: ManifestFile) -> None:
    missing = [(key, file) for key, file in named_files(source.manifest) if not source.resolve(file).is_file()]
    if missing:
        key, file = missing[0]
        others = f" (and {len(missing) - 1} more)" if len(missing) > 1 else ""
        raise source.error(key, f"{source.resolve(file)} does not exist{others}")


def _write_parts(source: ManifestFile, part: Path, out_dir: Path) -> None:
    manifest = source.manifest
    if manifest.calibration is not None:
        sizes = _run_sizes(source, manifest.run)
        _write_calibration(source, manifest.calibration, sizes, part / CALIBRATION_FOLDER)
    if manifest.run is not None:
        _write_run(source, manifest.run, part / RUN_FOLDER, out_dir.name)


def _summary(source: ManifestFile, out_dir: Path) -> Imported:
    calibration, run = source.manifest.calibration, source.manifest.run
    cameras = dict.fromkeys([*(calibration.cameras if calibration else ()), *(run.shot[0].frame_a if run else ())])
    return Imported(
        calibration=str(out_dir / CALIBRATION_FOLDER) if calibration else None,
        run=str(out_dir / RUN_FOLDER) if run else None,
        cameras=list(cameras),
        planes=len(calibration.plane) if calibration else 0,
        shots=len(run.shot) if run else 0,
    )


def _image(source: ManifestFile, key: Key, file: str) -> GreyImage:
    try:
        return read_image(source.resolve(file))
    except ImageFileError as error:
        raise source.error(key, str(error)) from error


def _run_sizes(source: ManifestFile, run: RunEntry | None) -> dict[str, tuple[int, int]]:
    """Width and height of each camera's images in the run: measured points alone do not tell."""
    if run is None:
        return {}
    images = {
        camera: _image(source, ("run", "shot", 0, "frame_a", camera), file)
        for camera, file in run.shot[0].frame_a.items()
    }
    return {camera: (image.shape[1], image.shape[0]) for camera, image in images.items()}


def _write_calibration(
    source: ManifestFile, calibration: CalibrationEntry, sizes: Mapping[str, tuple[int, int]], folder: Path
) -> None:
    """Copy images and tables as they are, and say in ``set.json`` what they are."""
    folder.mkdir()
    planes = tuple(
        plane.model_copy(update={"images": _copy_plane(source, number, plane, folder)})
        for number, plane in enumerate(calibration.plane)
    )
    points = tuple(
        _copy_points(source, number, entry, sizes, folder) for number, entry in enumerate(calibration.points)
    )
    write_set_file(folder, source.path.stem, calibration.model_copy(update={"plane": planes, "points": points}))


def _copy_plane(source: ManifestFile, number: int, plane: PlaneEntry, folder: Path) -> dict[str, str]:
    copies = {}
    for camera, file in plane.images.items():
        _image(source, ("calibration", "plane", number, "images", camera), file)
        copies[camera] = _copy(source.resolve(file), folder, f"images/{number:03d}")
    return copies


def _copy_points(
    source: ManifestFile, number: int, entry: PointsEntry, sizes: Mapping[str, tuple[int, int]], folder: Path
) -> PointsEntry:
    copied: dict[str, object] = {"file": _copy(source.resolve(entry.file), folder, f"points/{number:03d}")}
    if entry.image is not None:
        _image(source, ("calibration", "points", number, "image"), entry.image)
        copied["image"] = _copy(source.resolve(entry.image), folder, f"points/{number:03d}")
    elif entry.image_size_px is None:
        copied["image_size_px"] = sizes.get(entry.camera)
    return entry.model_copy(update=copied)


def _copy(file: Path, folder: Path, place: str) -> str:
    target = folder / place / file.name
    target.parent.mkdir(parents=True, exist_ok=True)
    if not target.exists():
        shutil.copyfile(file, target)
    return str(target.relative_to(folder))


def _write_run(source: ManifestFile, run: RunEntry, run_dir: Path, run_id: str) -> None:
    header = RunHeader(
        run_id=run_id,
        created_utc=datetime.now(UTC).isoformat(timespec="seconds"),
        views=_formats(source, run),
        frames_per_shot=2 if run.shot[0].frame_b else 1,
        configuration={"import": {"manifest": source.path.name, "sha256": _sha256(source.text)}},
        software={"tomoshadow": version("tomoshadow")},
        polarity=run.polarity,
        separation_ns=run.separation_ns,
    )
    references = {ImageKey.DARK: _Mean(), ImageKey.BACKGROUND: _Mean()}
    with RunWriter(run_dir, header) as writer:
        for shot in _shots(source, run, header):
            writer.write_shot(shot)
            if shot.image_key in references:
                references[shot.image_key].add(shot)
        means = {key: reference.images() for key, reference in references.items()}
        if any(means.values()):
            writer.write_references(dark=means[ImageKey.DARK], background=means[ImageKey.BACKGROUND])
        writer.finish("completed", f"imported from {source.path.name}")


def _formats(source: ManifestFile, run: RunEntry) -> dict[str, ViewFormat]:
    formats = {}
    for camera, file in run.shot[0].frame_a.items():
        image = _image(source, ("run", "shot", 0, "frame_a", camera), file)
        formats[camera] = ViewFormat((image.shape[0], image.shape[1]), 8 * image.itemsize)
    return formats


def _shots(source: ManifestFile, run: RunEntry, header: RunHeader) -> Iterator[Shot]:
    index = 0
    for kind, image_key in _KINDS:
        for number, entry in enumerate(getattr(run, kind)):
            key: Key = ("run", kind, number)
            frames = [
                {camera: _frame(source, (*key, name, camera), file, header) for camera, file in images.items()}
                for name, images in zip(("frame_a", "frame_b"), entry.frames, strict=False)
            ]
            yield Shot(index, image_key, {camera: _double_frame(frames, camera) for camera in header.views})
            index += 1


def _frame(source: ManifestFile, key: Key, file: str, header: RunHeader) -> GreyImage:
    image, expected = _image(source, key, file), header.views[str(key[-1])]
    if image.shape != expected.shape or image.dtype != expected.dtype:
        raise source.error(
            key,
            f"{source.resolve(file)}: {image.shape[1]} x {image.shape[0]} px of {8 * image.itemsize} bit, the first "
            f"image of this camera has {expected.shape[1]} x {expected.shape[0]} px of {expected.bits} bit",
        )
    return image


def _double_frame(frames: list[dict[str, GreyImage]], camera: str) -> DoubleFrame:
    frame_b = frames[1][camera] if len(frames) == 2 else None
    return DoubleFrame(
        frames[0][camera], frame_b, ExposureRecord(valid=True), ExposureRecord(valid=frame_b is not None)
    )


class _Mean:
    """Mean of shots, A and B apart."""

    def __init__(self) -> None:
        self._totals: dict[str, NDArray[np.float32]] = {}
        self._count = 0

    def add(self, shot: Shot) -> None:
        """Count one more shot in."""
        self._count += 1
        for camera, exposures in shot.views.items():
            frames = [frame for frame in (exposures.frame_a, exposures.frame_b) if frame is not None]
            stack = np.stack(frames).astype(np.float32)
            self._totals[camera] = self._totals[camera] + stack if camera in self._totals else stack

    def images(self) -> dict[str, NDArray[np.float32]]:
        """(frame, row, column) means by camera; empty without shots."""
        return {camera: total / np.float32(self._count) for camera, total in self._totals.items()}


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
