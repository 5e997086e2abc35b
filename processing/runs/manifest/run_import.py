"""Images from elsewhere become a run: every exposure is read, checked, and kept as a shot."""

import hashlib
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from daq.files.run_directory import DoubleFrame, ExposureRecord, ImageKey, RunHeader, RunWriter, Shot, ViewFormat
from processing.image_file import GreyImage, ImageFileError, read_image
from processing.runs.manifest.import_manifest import ManifestFile, RunEntry
from processing.runs.manifest.shot_sources import ImageSource, ShotSource

CAMERA_BITS = (8, 10, 12, 14)
"""What cameras have whose images are kept in files of 16 bit; images that need no more must be said to."""

Done = Callable[[int, int], None]


class ExposureReader:
    """Reads the images of a run, and sees to it that those of a camera are alike and within the bits that are stated.

    Parameters
    ----------
    source : ManifestFile
        Where paths start, and where errors point to.
    run : RunEntry
        Says how many bits a grey value has, and whether an image is two exposures.
    first : ShotSource
        Its images say what those of every camera are like.
    """

    def __init__(self, source: ManifestFile, run: RunEntry, first: ShotSource) -> None:
        self._source, self._run = source, run
        images = {camera: read_source(source, image) for camera, image in first.frames[0].items()}
        self._first = {camera: (image.shape, image.dtype) for camera, image in images.items()}
        self._brightest = dict.fromkeys(self._first, 0)
        if run.bits not in (None, 8) and all(dtype == np.uint8 for _, dtype in self._first.values()):
            raise source.error(("run", "bits"), f"{run.bits}, and the images have 8 bits")
        self.formats = {camera: self._format(*kind) for camera, kind in self._first.items()}

    def _format(self, shape: tuple[int, ...], dtype: np.dtype[Any]) -> ViewFormat:
        """Size of one exposure, and significant bits; a file of 8 bits has 8, whatever the others have."""
        rows = shape[0] // 2 if self._run.double_height else shape[0]
        return ViewFormat((rows, shape[1]), 8 if dtype == np.uint8 else self._run.bits or 16)

    def exposures(self, camera: str, image: ImageSource) -> list[GreyImage]:
        """The exposure of an image, or the two of it.

        Raises
        ------
        ManifestError
            It differs from the first image of the camera, or is brighter than its bits allow.
        """
        pixels = read_source(self._source, image)
        self._check_alike(camera, image, pixels)
        pixels = self._significant(camera, image, pixels)
        half = len(pixels) // 2
        return [pixels[:half], pixels[half:]] if self._run.double_height else [pixels]

    def unused_bits(self) -> tuple[str, ...]:
        """What to tell of cameras whose images leave the upper bits of their files unused without a word of it.

        Shadows are divided by the light around them, whatever full scale is; bright particles are not.

        Raises
        ------
        ManifestError
            They are bright particles, and full scale would be the wrong one; names a camera and its brightest value.
        """
        notes = []
        for camera, (_, dtype) in self._first.items():
            brightest = self._brightest[camera]
            needed = next((bits for bits in CAMERA_BITS if brightest < 2**bits), None)
            if self._run.bits is None and dtype == np.uint16 and needed:
                notes.append(
                    f"{camera}: the brightest pixel of all its images is {brightest}, and the files could hold 65535; "
                    f"state the bits of the camera (bits = {needed}), or bits = 16 if the images are as dark as that"
                )
        if notes and self._run.polarity == "bright":
            raise self._source.error(("run",), notes[0])
        return tuple(notes)

    def _check_alike(self, camera: str, image: ImageSource, pixels: GreyImage) -> None:
        (rows, columns), dtype = self._first[camera]
        if (pixels.shape, pixels.dtype) != self._first[camera]:
            raise self._source.error(
                image.key,
                f"{self._source.resolve(image.file)}: {pixels.shape[1]} x {pixels.shape[0]} px of "
                f"{8 * pixels.itemsize} bit, the first image of this camera has {columns} x {rows} px of "
                f"{8 * dtype.itemsize} bit",
            )
        if self._run.double_height and rows % 2:
            raise self._source.error(
                image.key, f"{self._source.resolve(image.file)}: {rows} rows are not two exposures"
            )

    def _significant(self, camera: str, image: ImageSource, pixels: GreyImage) -> GreyImage:
        """The same grey values, in bytes where they have no more than 8 bits."""
        kept, brightest = self.formats[camera], int(pixels.max())
        self._brightest[camera] = max(self._brightest[camera], brightest)
        if brightest >= 2**kept.bits:
            raise self._source.error(
                image.key,
                f"{self._source.resolve(image.file)}: a pixel of {brightest}, {kept.bits} bits reach to "
                f"{2**kept.bits - 1}; leave bits out if the grey values fill the 16 bits of the file",
            )
        return pixels.astype(kept.dtype, copy=False)


def read_source(source: ManifestFile, image: ImageSource) -> GreyImage:
    """Read one image that a manifest names; an error names the line."""
    try:
        return read_image(source.resolve(image.file), image.page)
    except ImageFileError as error:
        raise source.error(image.key, str(error)) from error


def write_run(
    source: ManifestFile, run: RunEntry, shots: Sequence[ShotSource], reader: ExposureReader, run_dir: Path, done: Done
) -> tuple[str, ...]:
    """Write shots as a run with the means of its backgrounds and darks; notes on what may be wrong with them."""
    header = _header(source, run, reader, run_dir.parent.name)
    references, copies = {ImageKey.DARK: _Mean(), ImageKey.BACKGROUND: _Mean()}, _Copies()
    with RunWriter(run_dir, header) as writer:
        for index, origin in enumerate(shots):
            shot = Shot(index, origin.image_key, {camera: _frames(reader, origin, camera) for camera in header.views})
            writer.write_shot(shot)
            copies.look_at(shot)
            if shot.image_key in references:
                references[shot.image_key].add(shot)
            done(index + 1, len(shots))
        notes = (*reader.unused_bits(), *copies.notes())
        means = {key: reference.images() for key, reference in references.items()}
        if any(means.values()):
            writer.write_references(dark=means[ImageKey.DARK], background=means[ImageKey.BACKGROUND])
        writer.finish("completed", f"imported from {source.path.name}")
    return notes


def _header(source: ManifestFile, run: RunEntry, reader: ExposureReader, run_id: str) -> RunHeader:
    return RunHeader(
        run_id=run_id,
        created_utc=datetime.now(UTC).isoformat(timespec="seconds"),
        views=reader.formats,
        frames_per_shot=run.frames_per_shot,
        configuration={"import": {"manifest": source.path.name, "sha256": _sha256(source.text)}},
        software={"tomoshadow": version("tomoshadow")},
        polarity=run.polarity,
        separation_ns=run.separation_ns,
        rate_hz=run.rate_hz,
        notes=run.notes,
        spray=source.manifest.spray,
    )


def _frames(reader: ExposureReader, shot: ShotSource, camera: str) -> DoubleFrame:
    frames = [pixels for images in shot.frames for pixels in reader.exposures(camera, images[camera])]
    frame_b = frames[1] if len(frames) == 2 else None
    return DoubleFrame(frames[0], frame_b, ExposureRecord(valid=True), ExposureRecord(valid=frame_b is not None))


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


_KINDS = {ImageKey.DARK: "dark", ImageKey.BACKGROUND: "background"}


class _Copies:
    """Exposures that have the very pixels of another one: noise never repeats.

    Among dark images, and among backgrounds, one file may stand for several.
    """

    def __init__(self) -> None:
        self._first: dict[bytes, tuple[ImageKey, str]] = {}
        self._copies: list[str] = []

    def look_at(self, shot: Shot) -> None:
        """Compare the exposures of one more shot; those without any contrast tell nothing."""
        for camera, exposures in shot.views.items():
            for letter, frame in (("A", exposures.frame_a), ("B", exposures.frame_b)):
                if frame is not None and frame.min() < frame.max():
                    name = f"{camera}, {_KINDS.get(shot.image_key, 'shot')} {shot.index}, exposure {letter}"
                    self._compare(shot.image_key, name, frame)

    def _compare(self, kind: ImageKey, name: str, frame: NDArray[Any]) -> None:
        of_kind, first = self._first.setdefault(hashlib.sha256(frame.tobytes()).digest(), (kind, name))
        if first != name and (kind != of_kind or kind == ImageKey.SAMPLE):
            self._copies.append(f"{name} has the very pixels of {first}")

    def notes(self) -> tuple[str, ...]:
        """What to tell of copies."""
        if not self._copies:
            return ()
        others = f" (and {len(self._copies) - 1} more like it)" if len(self._copies) > 1 else ""
        return (f"{self._copies[0]}{others}: has a file been copied, or did a camera send an image again?",)


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
