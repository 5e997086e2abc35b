"""RUN/run.h5: what the run is, its reference images, its outcome, and a view over all its shots.

The view is written once, before the first shot, and grows by itself as ``shots/N.h5`` appear. References and
outcome are added to a copy that replaces the file, so that a complete ``run.h5`` exists at every instant.
"""

import json
import os
import re
import zlib
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5d, h5p, h5s, h5t
from pydantic import TypeAdapter

from daq.causes import Cause
from daq.errors import RecorderError, ShotFileError
from daq.files.atomic_file import amending, replacing, reserve, spending_reserve
from daq.files.columns import BITS, columns_of, frames_path, unlike_bits
from daq.files.header import RunClosing, RunHeader
from daq.files.shot_file import LIBRARY_VERSIONS, SCHEMA_VERSION, create_groups, unreadable
from daq.files.text_heap import has_whole_heaps
from daq.run_notes import RunNotes

RUN_FILE = "run.h5"
_LATER_FIELDS = ("rate_hz", "notes", "spray")
"""Of the header; runs from before have their defaults."""
_CAUSES = TypeAdapter(tuple[Cause, ...])
SHOTS_FOLDER = "shots"
_SOURCE = f"{SHOTS_FOLDER}/%b.h5"
"""Where the view over all shots looks for shot %b."""
_SHOT_NAME = re.compile(r"(0|[1-9][0-9]{0,6})\.h5")
"""Up to ten million, which no plan reaches: a stray number of more digits would be a slot for every number below it."""
_CLOSING_BYTES = 256 * 2**10
"""What the end of a run adds to its file at most: outcome, causes, numbers of the shots that were not stored."""
RUN_SCHEMA = "tomoshadow-run"
_LATER_NOTES = "later_notes"


def shot_path(run_dir: Path, index: int) -> Path:
    """File of one shot."""
    return run_dir / SHOTS_FOLDER / f"{index}.h5"


def write_run_file(run_dir: Path, header: RunHeader) -> None:
    """Write header and view of a run that has no shots yet."""
    with replacing(run_dir / RUN_FILE) as part, h5py.File(part, "w", libver=LIBRARY_VERSIONS) as file:
        file.attrs.update(schema=RUN_SCHEMA, schema_version=SCHEMA_VERSION, default="entry")
        create_groups(file, header)
        _write_entry(file.create_group("entry"), header)
        _write_view(file, header)


def reserve_closing(run_dir: Path) -> None:
    """Keep room for the outcome, whatever fills the disk in the meantime; again after every change of the file."""
    reserve(run_dir / RUN_FILE, _CLOSING_BYTES)


def read_header(run_dir: Path) -> RunHeader:
    """Read what the run is.

    Raises
    ------
    ShotFileError
        The file is missing, damaged, or of a newer version.
    """
    with reading(run_dir) as file:
        entry = file["entry"]
        written = [name for name in RunHeader.model_fields if name in entry or name not in _LATER_FIELDS]
        return RunHeader.model_validate({name: json.loads(_read_text(entry, name)) for name in written})


def set_devices(run_dir: Path, devices: Mapping[str, Mapping[str, str]]) -> None:
    """Write down what the devices say they are: they are asked when the run exists already."""
    with changing(amending(run_dir / RUN_FILE)) as file:
        del file["entry/devices"]
        _write_text(file["entry"], "devices", json.dumps(devices, indent=1))


def add_closing(run_dir: Path, closing: RunClosing) -> None:
    """Close the run: how it ended, why, and when.

    Raises
    ------
    RecorderError
        The run has an outcome already.
    """
    with changing(spending_reserve(run_dir / RUN_FILE)) as file:
        if "outcome" in file["entry"]:
            raise RecorderError(f"{run_dir}: has an outcome already, {file['entry/outcome'].asstr()[()]}")
        _write_text(file["entry"], "outcome", closing.outcome)
        _write_text(file["entry"], "cause", closing.cause)
        _write_text(file["entry"], "end_time", closing.ended_utc)
        _write_text(file["entry"], "unstored", json.dumps(closing.unstored))
        _write_text(file["entry"], "causes", _CAUSES.dump_json(closing.causes, indent=1).decode())
        file["entry/shot_count"] = slots_of(run_dir)


def read_shot_count(run_dir: Path) -> int:
    """Slots of a run when it was closed; 0 while it is open, and of runs from before this was kept."""
    with reading(run_dir) as file:
        return int(file["entry/shot_count"][()]) if "shot_count" in file["entry"] else 0


def slots_of(run_dir: Path) -> int:
    """Slots up to the last shot that is there."""
    with suppress(FileNotFoundError, NotADirectoryError, PermissionError), os.scandir(run_dir / SHOTS_FOLDER) as found:
        return max((int(entry.name.removesuffix(".h5")) for entry in found if is_shot(entry)), default=-1) + 1
    return 0


def is_shot(entry: Path | os.DirEntry[str]) -> bool:
    """Whether something among the shots is a file named as ``shot_path`` names one."""
    return bool(_SHOT_NAME.fullmatch(entry.name)) and entry.is_file()


def read_closing(run_dir: Path) -> RunClosing | None:
    """How, why and when the run ended; None while it is open, and for ever if its process was killed."""
    with reading(run_dir) as file:
        entry = file["entry"]
        if "outcome" not in entry:
            return None
        outcome, cause, ended_utc = (_read_text(entry, name) for name in ("outcome", "cause", "end_time"))
        later = {name: _read_text(entry, name) for name in ("causes", "unstored") if name in entry}  # not in old runs
        causes, unstored = _CAUSES.validate_json(later.get("causes", "[]")), json.loads(later.get("unstored", "[]"))
        return RunClosing(outcome, cause, ended_utc, causes, tuple(unstored))


def other_programs_see(run_dir: Path, header: RunHeader) -> Iterator[str]:
    """What a reader of HDF5 sees in ``run.h5`` that is not what the shots hold, or not what was written of the run."""
    with reading(run_dir) as file:
        groups = [file[path] for path in ("entry", "entry/user", "entry/sample") if path in file]  # old runs lack two
        texts = [item for group in groups for item in group.values() if _is_text(item)]
        for text in texts:
            try:
                _read_text(text.parent, text.name.rpartition("/")[2])
            except ShotFileError as error:
                yield str(error)
        paths = (*map(frames_path, header.views), *columns_of(header))
        for path in paths:
            if path in file and not _shows_shots(file[path]):
                yield (
                    f"{file.filename}: {path} is not that of the shots: other programs see something else there; "
                    "copy it back from a backup"
                )
        yield from unlike_bits(file, header)


def read_later_notes(run_dir: Path) -> str:
    """Changes of the notes, as JSON, in a packed file; empty if there are none (``daq.files.later_notes``)."""
    with reading(run_dir) as file:
        return _read_text(file["entry"], _LATER_NOTES) if _LATER_NOTES in file["entry"] else ""


def write_later_notes(file: h5py.File, changes: str) -> None:
    """Give a packed file the changes of the notes."""
    _write_text(file["entry"], _LATER_NOTES, changes)


@contextmanager
def reading(run_dir: Path) -> Iterator[h5py.File]:
    """Open ``run.h5`` and turn what can go wrong into ShotFileError."""
    path = run_dir / RUN_FILE
    if not path.exists():
        missing = f"no run, it has no {RUN_FILE}" if run_dir.is_dir() else "there is no such directory"
        if run_dir.is_file():
            missing = "is a file, and a run is a directory: images become one by tomoshadow import"
        raise ShotFileError(f"{run_dir}: {missing}")
    try:
        if not has_whole_heaps(path):
            raise ShotFileError(f"{path}: is damaged, its texts cannot be read: copy it back from a backup")
        with h5py.File(path, "r") as file:
            schema, version = file.attrs["schema"], file.attrs["schema_version"]
            if schema != RUN_SCHEMA or version > SCHEMA_VERSION:
                raise ShotFileError(f"{path}: {schema} {version}, this program reads {RUN_SCHEMA} {SCHEMA_VERSION}")
            yield file
    except (OSError, KeyError, ValueError, TypeError, AttributeError, RuntimeError) as error:
        raise unreadable(path, error) from error


@contextmanager
def changing(copied: AbstractContextManager[Path]) -> Iterator[h5py.File]:
    """Open a copy of ``run.h5`` that takes its place when it is closed."""
    with copied as copy, h5py.File(copy, "r+", libver=LIBRARY_VERSIONS) as file:
        yield file


def _write_entry(entry: h5py.Group, header: RunHeader) -> None:
    """Every field of the header as JSON, and what NeXus readers look for."""
    entry.attrs["NX_class"] = "NXentry"
    for name, value in header.model_dump(mode="json").items():
        _write_text(entry, name, json.dumps(value, indent=1))
    _write_text(entry, "title", header.plan.name if header.plan else header.run_id)
    entry["definition"] = RUN_SCHEMA
    entry["definition"].attrs["version"] = str(SCHEMA_VERSION)
    _write_conditions(entry, header.notes)
    _write_text(entry, "entry_identifier", header.run_id)
    _write_text(entry, "start_time", header.created_utc)
    instrument = entry.create_group("instrument")
    instrument.attrs["NX_class"] = "NXinstrument"
    for view in header.views:
        detector = instrument.create_group(view)
        detector.attrs["NX_class"] = "NXdetector"
        detector["data"] = h5py.SoftLink(frames_path(view))
        data = entry.create_group(f"data_{view}")
        data.attrs.update(NX_class="NXdata", signal="frames", axes=["index", ".", ".", "."])
        data["frames"] = h5py.SoftLink(frames_path(view))
        data["index"] = h5py.SoftLink("/shots/index")
    entry.attrs["default"] = f"data_{next(iter(header.views))}"


def _write_text(entry: h5py.Group, name: str, text: str) -> None:
    entry[name] = text
    entry[name].attrs["crc32"] = np.uint32(zlib.crc32(text.encode()))


def _read_text(entry: h5py.Group, name: str) -> str:
    """A text that is as it was written; in runs from before nothing tells."""
    written = entry[name]
    text: str = written.asstr()[()]
    check = written.attrs.get("crc32")
    if check is not None and int(check) != zlib.crc32(text.encode()):
        raise ShotFileError(f"{entry.file.filename}: its {name} is not what was written: copy it back from a backup")
    return text


def _is_text(item: h5py.Group | h5py.Dataset) -> bool:
    return isinstance(item, h5py.Dataset) and h5py.check_string_dtype(item.dtype) is not None


def _shows_shots(dataset: h5py.Dataset) -> bool:
    """Whether it is the view that ``_create_virtual`` has made."""
    sources = dataset.virtual_sources() if dataset.is_virtual else []
    return [(one.file_name, one.dset_name) for one in sources] == [(_SOURCE, dataset.name)]


def _write_conditions(entry: h5py.Group, notes: RunNotes) -> None:
    """What the notes say, where NeXus readers look for it."""
    user, sample = entry.create_group("user"), entry.create_group("sample")
    user.attrs["NX_class"], sample.attrs["NX_class"] = "NXuser", "NXsample"
    _write_text(user, "name", notes.operator)
    _write_text(sample, "name", notes.fluid)
    _write_text(sample, "description", "; ".join(part for part in (notes.nozzle, notes.remark) if part))
    if notes.pressure_bar is not None:
        sample["pressure"] = notes.pressure_bar
        sample["pressure"].attrs["units"] = "bar"


def _write_view(file: h5py.File, header: RunHeader) -> None:
    for view, view_format in header.views.items():
        frames = _create_virtual(
            file, frames_path(view), view_format.dtype, (header.frames_per_shot, *view_format.shape)
        )
        frames.attrs.update(units="counts", dimensions="shot,frame,row,column", **{BITS: view_format.bits})
    for path, column in columns_of(header).items():
        dataset = _create_virtual(file, path, np.dtype(column.dtype), column.shape)
        dataset.attrs.update(units=column.units, dimensions=column.axes)


def _create_virtual(file: h5py.File, path: str, dtype: np.dtype[Any], shape: tuple[int, ...]) -> h5py.Dataset:
    """Create a dataset (shot, ...) mapped to the same path in ``shots/%b.h5``; %b counts blocks of one shot."""
    source, endless, zeros = (1, *shape), (h5s.UNLIMITED, *shape), (0,) * (1 + len(shape))
    space = h5s.create_simple(source, endless)
    space.select_hyperslab(zeros, (h5s.UNLIMITED, *(1,) * len(shape)), source, source)
    layout = h5p.create(h5p.DATASET_CREATE)
    layout.set_virtual(space, _SOURCE.encode(), path.encode(), h5s.create_simple(source))
    return h5py.Dataset(h5d.create(file.id, path.encode(), h5t.py_create(dtype, logical=True), space, layout))
