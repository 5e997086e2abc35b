"""RUN/shots/N.h5: one shot. Written to a part, fsynced, committed by rename; never written again."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import h5py
import numpy as np
from h5py import h5d, h5p, h5s, h5t
from numpy.typing import NDArray

from daq.errors import DamagedFrame, DamagedNumbers, ForeignFile, RecorderError, RenamedFile, ShotFileError
from daq.files.columns import (
    BITS,
    SHOT_VERSION,
    Column,
    columns_of,
    crc32_of,
    crc32_path,
    frames_path,
    shot_from_columns,
    shot_to_columns,
    unlike_bits,
    view_path,
)
from daq.files.encoding import EncodedFrame, decode_frame, encode_frame, is_shuffled
from daq.files.header import RunHeader, ViewFormat
from daq.files.text_heap import has_whole_heaps
from daq.run_plan import ImageKey
from daq.shot import Image, Shot

LIBRARY_VERSIONS = ("v110", "v110")
"""Format of every file: newer formats cannot be opened by the HDF5 1.10 tools of current distributions."""
SHOT_SCHEMA = "tomoshadow-shot"
SCHEMA_VERSION = 1
_FIXED_TEXTS = 2
"""Since this version no text lies in a heap."""
_BEGAN = "run_created_utc"
"""Attribute with the time of the run, as two runs may have one name; files from before have none."""
_SEAL = "columns_crc32"
"""Attribute with the CRC-32 of all columns, those of the frames among them; files from before have none."""


@dataclass(frozen=True)
class EncodedShot:
    """A shot as it goes to disk: frames as chunks, numbers as columns."""

    frames: Mapping[str, list[EncodedFrame]]
    columns: Mapping[str, NDArray[Any]]

    @property
    def size_bytes(self) -> int:
        """Size of its frames, which is all but some kilobytes."""
        return sum(len(frame.chunk) for frames in self.frames.values() for frame in frames)


def encode_shot(shot: Shot, header: RunHeader) -> EncodedShot:
    """Compress the frames of a shot; releases the GIL for most of the time.

    Raises
    ------
    RecorderError
        The shot does not have the format that the header of the run announces.
    """
    if set(shot.views) != set(header.views):
        raise RecorderError(f"shot {shot.index} has views {sorted(shot.views)}, the run {sorted(header.views)}")
    try:
        columns = shot_to_columns(shot, header)
    except ValueError as error:
        raise RecorderError(f"shot {shot.index}: {error}") from error
    frames: dict[str, list[EncodedFrame]] = {}
    for view, view_format in header.views.items():
        images = _checked_images(shot, view, view_format, header.frames_per_shot)
        frames[view] = [encode_frame(image.astype(view_format.dtype, copy=False)) for image in images]
        columns[crc32_path(view)] = np.array([frame.crc32 for frame in frames[view]], "u4")
    return EncodedShot(frames, columns)


def write_encoded_shot(path: Path, encoded: EncodedShot, header: RunHeader) -> None:
    """Write one file; the caller syncs and commits it."""
    described = columns_of(header)
    with h5py.File(path, "w", libver=LIBRARY_VERSIONS) as file:
        file.attrs.update(_fixed(schema=SHOT_SCHEMA, schema_version=SHOT_VERSION, run_id=header.run_id))
        file.attrs.update(_fixed(**{_BEGAN: header.created_utc}) if header.created_utc else {})
        create_groups(file, header, _fixed)
        for view, view_format in header.views.items():
            frames = create_frames(file, view, view_format, (1, header.frames_per_shot), _fixed)
            for number, frame in enumerate(encoded.frames[view]):
                frames.id.write_direct_chunk((0, number, 0, 0), frame.chunk)
        for name, values in encoded.columns.items():
            _create_column(file, name, described[name], values)
        file.attrs[_SEAL] = np.uint32(crc32_of(header.run_id, encoded.columns))


@contextmanager
def reading_shot(path: Path, header: RunHeader) -> Iterator[h5py.File]:
    """Open a shot of this run and turn what can go wrong into ShotFileError."""
    try:
        with h5py.File(path, "r") as file:
            _check_heaps(path, file)
            if (_text(file.attrs["schema"]), _text(file.attrs["run_id"])) != (SHOT_SCHEMA, header.run_id):
                raise ForeignFile(f"{path}: not a shot of run {header.run_id}")
            if (version := file.attrs["schema_version"]) > SHOT_VERSION:
                raise ShotFileError(f"{path}: version {version}, this program reads {SHOT_VERSION}: take a newer one")
            began = _text(file.attrs.get(_BEGAN, header.created_utc))
            if header.created_utc and began != header.created_utc:
                raise ForeignFile(f"{path}: of another run of this name, which began at {began}")
            yield file
    except (OSError, KeyError, ValueError, IndexError, TypeError, AttributeError, RuntimeError) as error:
        raise unreadable(path, error) from error


Exposures = Literal["a", "ab"]
"""Of a shot: A alone, as if the run had single exposures, or all that it has."""


def read_shot_file(path: Path, header: RunHeader, exposures: Exposures = "ab") -> Shot:
    """Read one shot, or exposure A of it, and check it against its checksums.

    Raises
    ------
    ShotFileError
        The file is missing, torn, damaged, or belongs to another run; the text names it.
    """
    with reading_shot(path, header) as file:
        columns = _read_columns(path, file, header)
        for told in unlike_bits(file, header):
            raise DamagedNumbers(told)
        frames = {
            view: _read_frames(path, file, view, view_format, columns[crc32_path(view)], exposures)
            for view, view_format in header.views.items()
        }
        return shot_from_columns(columns, frames)


def read_shot_of(path: Path, header: RunHeader, index: int, exposures: Exposures = "ab") -> Shot:
    """Read the shot that has this number, likewise; ShotFileError too if the file holds another one."""
    shot = read_shot_file(path, header, exposures)
    if shot.index != index:
        raise RenamedFile(f"{path}: holds shot {shot.index}, and is named otherwise: give it its name back")
    return shot


def read_image_key(path: Path) -> ImageKey:
    """Read what a shot shows; INVALID if its file cannot be read."""
    try:
        with h5py.File(path, "r") as file:
            return ImageKey(int(file["/shots/image_key"][0]))
    except (OSError, KeyError, ValueError, IndexError, TypeError, AttributeError, RuntimeError):
        return ImageKey.INVALID


Attributes = Mapping[str, Any]


def create_groups(file: h5py.File, header: RunHeader, stored: Callable[..., Attributes] = dict) -> None:
    """Create the groups that shot files and ``run.h5`` have in common; ``stored`` says how texts are kept."""
    file.attrs.update(stored(NX_class="NXroot"))
    file.create_group("shots").attrs.update(stored(NX_class="NXcollection"))
    file.create_group("cameras").attrs.update(stored(NX_class="NXinstrument"))
    for view in header.views:
        file.create_group(view_path(view, "")).attrs.update(stored(NX_class="NXdetector"))


def create_frames(
    file: h5py.File,
    view: str,
    view_format: ViewFormat,
    leading: tuple[int, int],
    stored: Callable[..., Attributes] = dict,
) -> h5py.Dataset:
    """Create the dataset for the frames of one view, (shot, frame, row, column), one chunk per frame."""
    dataset = file.create_dataset(
        frames_path(view),
        (*leading, *view_format.shape),
        view_format.dtype,
        maxshape=(max(1, leading[0]), leading[1], *view_format.shape),  # h5py: no chunk is longer than its axis may be
        chunks=(1, 1, *view_format.shape),
        compression="gzip",
        compression_opts=1,
        shuffle=is_shuffled(view_format.dtype),
    )
    dataset.attrs.update(stored(units="counts", dimensions="shot,frame,row,column", **{BITS: view_format.bits}))
    return dataset


def _checked_images(shot: Shot, view: str, view_format: ViewFormat, count: int) -> list[Image]:
    double_frame = shot.views[view]
    images = [image for image in (double_frame.frame_a, double_frame.frame_b) if image is not None]
    if len(images) != count:
        raise RecorderError(f"shot {shot.index}, {view}: {len(images)} exposures, the run stores {count}")
    for image in images:
        if image.shape != view_format.shape or image.dtype.newbyteorder("<") != view_format.dtype:
            raise RecorderError(
                f"shot {shot.index}, {view}: frame {image.shape} {image.dtype}, "
                f"the run stores {view_format.shape} {view_format.dtype}"
            )
    return images


def _create_column(file: h5py.File, name: str, column: Column, values: NDArray[Any]) -> None:
    """Compact storage: the values share the checksum of the object header."""
    layout = h5p.create(h5p.DATASET_CREATE)
    layout.set_layout(h5d.COMPACT)
    space = h5s.create_simple((1, *values.shape))
    kind = h5t.py_create(values.dtype, logical=True)
    stored = h5d.create(file.id, name.encode(), kind, space, layout)
    stored.write(h5s.ALL, h5s.ALL, np.ascontiguousarray(values[np.newaxis]))
    h5py.Dataset(stored).attrs.update(_fixed(units=column.units, dimensions=column.axes))


def _fixed(**attributes: Any) -> Attributes:
    """Texts of fixed length lie in the object header, whose checksum finds damage.

    Others would lie in a heap without a checksum, and HDF5 reads a damaged heap for ever.
    """
    return {name: np.bytes_(value.encode()) if isinstance(value, str) else value for name, value in attributes.items()}


def _check_heaps(path: Path, file: h5py.File) -> None:
    """OSError if HDF5 would read texts for ever; where they lie in heaps, their version does not."""
    if file.attrs["schema_version"] < _FIXED_TEXTS and not has_whole_heaps(path):
        raise OSError("a heap of texts is broken")


def _text(attribute: str | bytes) -> str:
    return attribute.decode() if isinstance(attribute, bytes) else attribute


def _read_columns(path: Path, file: h5py.File, header: RunHeader) -> dict[str, Any]:
    """Those that the file has, which its seal is of, and zeros for those that came later."""
    described = columns_of(header)
    columns = {name: _read_column(file, name) for name in columns_of(header, file.attrs["schema_version"])}
    written = file.attrs.get(_SEAL)
    if written is not None and int(written) != crc32_of(_text(file.attrs["run_id"]), columns):
        raise DamagedNumbers(f"{path}: its numbers are not those that were written: copy it back from a backup")
    return {name: columns.get(name, np.zeros(column.shape, column.dtype)) for name, column in described.items()}


def _read_column(file: h5py.File, name: str) -> Any:
    stored = h5d.open(file.id, name.encode())  # a shot has some sixty columns: h5py's own Dataset takes twice as long
    values = np.empty(stored.shape, stored.dtype)
    stored.read(h5s.ALL, h5s.ALL, values)
    return values[0]


def _read_frames(
    path: Path, file: h5py.File, view: str, view_format: ViewFormat, crc32: NDArray[Any], exposures: Exposures
) -> list[Image]:
    stored, shape, dtype = file[frames_path(view)].id, view_format.shape, view_format.dtype
    frames: list[Image] = []
    for number, (name, check) in enumerate(zip(exposures, crc32, strict=False)):
        chunk = stored.read_direct_chunk((0, number, 0, 0))[1]
        try:
            frames.append(decode_frame(EncodedFrame(chunk, int(check)), shape, dtype))
        except ValueError as error:
            raise DamagedFrame(f"{path}: exposure {name.upper()} of {view}: {error}") from error
    return frames


def unreadable(path: Path, error: Exception) -> ShotFileError:
    """Why a file of a run cannot be read, and what to do; the words of HDF5 help no operator and stay in the chain."""
    told = str(error)
    if isinstance(error, FileNotFoundError):
        told = "it is missing: copy it back from a backup"
    elif isinstance(error, PermissionError):
        told = "the permission to read it is missing"
    elif isinstance(error, OSError | RuntimeError):
        told = "it is torn or damaged: copy it back from a backup"
    return ShotFileError(f"{path}: cannot be read: {told}")


def read_began(path: Path) -> str:
    """When its run began, as a shot tells it; empty where it does not."""
    with h5py.File(path, "r") as file:
        return _text(file.attrs.get(_BEGAN, ""))


def read_formats(path: Path) -> tuple[str, dict[str, ViewFormat], int]:
    """Run id, views and exposures per view, as a shot tells them without the header of its run.

    Raises
    ------
    ShotFileError
        It cannot be read, or is no shot.
    """
    try:
        with h5py.File(path, "r") as file:
            _check_heaps(path, file)
            if _text(file.attrs["schema"]) != SHOT_SCHEMA:
                raise ForeignFile(f"{path}: not a shot")
            frames = {view: group["frames"] for view, group in file["cameras"].items()}
            views = {view: ViewFormat(one.shape[2:], int(one.attrs[BITS])) for view, one in frames.items()}
            return _text(file.attrs["run_id"]), views, max(one.shape[1] for one in frames.values())
    except (OSError, KeyError, ValueError, IndexError, TypeError, AttributeError, RuntimeError) as error:
        raise unreadable(path, error) from error
