"""References of a run: mean images without spray, kept in its ``run.h5``."""

import zlib
from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import Literal

import h5py
import numpy as np
from numpy.typing import NDArray

from daq.errors import RecorderError, ShotFileError
from daq.files.atomic_file import amending
from daq.files.columns import view_path
from daq.files.encoding import encode_frame, inflate
from daq.files.header import RunHeader
from daq.files.run_file import RUN_FILE, changing, reading

Reference = Literal["dark", "background"]
_NAMES: tuple[Reference, ...] = ("dark", "background")
ReferenceImages = Mapping[str, NDArray[np.float32]]


def add_references(run_dir: Path, header: RunHeader, references: Mapping[Reference, ReferenceImages]) -> None:
    """Store mean images, (frame, row, column) float32 per view.

    Raises
    ------
    RecorderError
        An image does not have the format of its view, or the run has such references already.
    """
    for name, images in references.items():
        for view, stack in images.items():
            _check_reference(run_dir, header, f"{name} of {view}", view, stack)
    with changing(amending(run_dir / RUN_FILE)) as file:
        for name, images in references.items():
            for view, stack in images.items():
                if view_path(view, name) in file:
                    raise RecorderError(f"{run_dir}: has a {name} of {view} already")
                _create_reference(file, view_path(view, name), np.asarray(stack, "<f4"))


def read_reference(run_dir: Path, view: str, name: Reference) -> NDArray[np.float32] | None:
    """Mean image (frame, row, column) of a view; None if the run has none."""
    with reading(run_dir) as file:
        path = view_path(view, name)
        return _read_images(file[path]) if path in file else None


def require_references(run_dir: Path, header: RunHeader) -> None:
    """Raise ShotFileError if one of them is not what was written; a view may have none."""
    for view, name in product(header.views, _NAMES):
        read_reference(run_dir, view, name)


def damaged_references(run_dir: Path, header: RunHeader) -> Iterator[str]:
    """What is wrong with references, one text for each of them: damaged, or missing of some views only."""
    known: dict[Reference, list[str]] = {name: [] for name in _NAMES}
    for view, name in product(header.views, _NAMES):
        try:
            if read_reference(run_dir, view, name) is not None:
                known[name].append(view)
        except ShotFileError as error:
            known[name].append(view)
            yield str(error)
    for name, views in known.items():
        if views and (missing := [view for view in header.views if view not in views]):
            yield (
                f"{run_dir / RUN_FILE}: no {name} of {', '.join(missing)}, and one of {', '.join(views)}: was it "
                "removed? Copy the file back from a backup"
            )


def _check_reference(run_dir: Path, header: RunHeader, what: str, view: str, stack: NDArray[np.float32]) -> None:
    if view not in header.views:
        raise RecorderError(f"{run_dir}: {what}: the run has views {sorted(header.views)}")
    expected = (header.frames_per_shot, *header.views[view].shape)
    if stack.shape != expected:
        raise RecorderError(f"{run_dir}: {what} has shape {stack.shape}, the run stores {expected}")


def _read_images(stored: h5py.Dataset) -> NDArray[np.float32]:
    """As ``_create_reference`` has written them, inflated by ISA-L: HDF5 itself takes three times as long.

    In runs from before nothing but the Adler-32 of each image tells whether they are.
    """
    images = np.empty(stored.shape, np.float32)
    for number, image in enumerate(images):
        chunk = stored.id.read_direct_chunk((number, 0, 0))[1]
        try:
            image[:] = inflate(chunk, image.shape, np.dtype("<f4"))
        except ValueError as error:
            raise OSError(f"{stored.name}: {error}") from error
    check = stored.attrs.get("crc32")
    if check is not None and int(check) != zlib.crc32(images.tobytes()):
        view, name = stored.name.split("/")[-2:]
        raise ShotFileError(
            f"{stored.file.filename}: {name} of {view} is not what was written: copy it back from a backup"
        )
    return images


def _create_reference(file: h5py.File, path: str, stack: NDArray[np.float32]) -> None:
    dataset = file.create_dataset(
        path, stack.shape, stack.dtype, chunks=(1, *stack.shape[1:]), compression="gzip", shuffle=True
    )
    check = zlib.crc32(np.ascontiguousarray(stack).tobytes())
    dataset.attrs.update(units="counts", dimensions="frame,row,column", crc32=np.uint32(check))
    for number, image in enumerate(stack):
        dataset.id.write_direct_chunk((number, 0, 0), encode_frame(image).chunk)
