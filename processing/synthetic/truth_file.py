"""truth.h5: what the simulated bench knows and a laboratory never does; kept beside a run, to judge results.

``/cameras/<view>`` holds the true camera models, ``/sprays/<sequence>`` the liquid of a firing at its first
light pulse. The key is the sequence number of the generator, which every shot records, and not the index of
the shot: a shot that was fired again has its own liquid. Sprays lie in files of their own beside that of the
cameras, ``sprays/<sequence>.h5``, written as they are fired; in version 1 they were in ``truth.h5`` too.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from daq.files.atomic_file import part_path
from daq.files.encoding import encode_frame
from processing.geometry import PinholeCamera
from processing.synthetic.spray import Spray

SCHEMA = "tomoshadow.truth"
VERSION = 2
_READABLE = (1, 2)

_UNITS = {
    "camera_matrix": "px",
    "rotation": "1",
    "translation_mm": "mm",
    "image_size_px": "px",
    "distortion": "1",
    "tilt_rad": "rad",
    "positions_mm": "mm",
    "diameters_mm": "mm",
    "velocities_mm_per_s": "mm/s",
    "kinds": "1",
    "opacities": "1",
}


class TruthFileError(Exception):
    """The file is no truth of a run, or holds no such firing; the text names the file."""


@dataclass(frozen=True)
class FiredSpray:
    """Liquid of one firing, at ``time_ns`` after its trigger."""

    time_ns: int
    spray: Spray


def write_true_cameras(path: Path, cameras: Mapping[str, PinholeCamera]) -> None:
    """Begin the truth of a run: the true camera models by view.

    Parameters
    ----------
    path : Path
        File to write; folders are made, an older file is replaced.
    cameras : mapping of view to PinholeCamera
        True camera models.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with _created(path) as file:
        for view, camera in cameras.items():
            group = file.create_group(f"cameras/{view}")
            for field in fields(camera):
                group[field.name] = np.asarray(getattr(camera, field.name))
                group[field.name].attrs["units"] = _UNITS[field.name]


def write_true_spray(path: Path, sequence: int, fired: FiredSpray) -> None:
    """Add the liquid of one firing to the truth of a run; it appears complete or not at all.

    Parameters
    ----------
    path : Path
        The file of ``write_true_cameras``; this one lies beside it.
    sequence : int
        Number of the firing.
    fired : FiredSpray
        Its liquid; numbers are kept in single precision, which is a nanometre.
    """
    final = _spray_path(path, sequence)
    final.parent.mkdir(exist_ok=True)
    with _created(part_path(final)) as file:
        group = file.create_group(_spray_group(sequence))
        group.attrs["time_ns"] = fired.time_ns
        for field in fields(Spray):
            data = np.asarray(getattr(fired.spray, field.name))
            _write_column(group, field.name, data if data.dtype == np.uint8 else data.astype("<f4"))
    part_path(final).rename(final)


def read_true_cameras(path: Path) -> dict[str, PinholeCamera]:
    """Read the true camera models by view.

    Raises
    ------
    TruthFileError
        The file is no truth of a run.
    """
    with _opened(path) as file:
        return {view: _camera(group) for view, group in file["cameras"].items()}


def read_true_spray(path: Path, sequence: int) -> FiredSpray:
    """Read the liquid of one firing.

    Raises
    ------
    TruthFileError
        The file is no truth of a run, or does not hold this firing.
    """
    beside = _spray_path(path, sequence)
    with _opened(beside if beside.exists() else path) as file:
        group = file.get(_spray_group(sequence))
        if group is None:
            raise TruthFileError(f"{path}: no spray of firing {sequence}")
        return FiredSpray(
            int(group.attrs["time_ns"]), Spray(**{field.name: _column(group, field.name) for field in fields(Spray)})
        )


def _spray_path(path: Path, sequence: int) -> Path:
    return path.with_name("sprays") / f"{sequence}.h5"


def _spray_group(sequence: int) -> str:
    return f"sprays/{sequence}"


def _created(path: Path) -> h5py.File:
    file = h5py.File(path, "w", libver=("v110", "v110"))
    file.attrs.update(schema=SCHEMA, version=VERSION, axes="x, y, z in mm; y points down; right-handed")
    return file


def _opened(path: Path) -> h5py.File:
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise TruthFileError(f"{path}: {error}") from error
    if file.attrs.get("schema") != SCHEMA or file.attrs.get("version") not in _READABLE:
        file.close()
        raise TruthFileError(f"{path}: not a {SCHEMA} file of version 1 or 2")
    return file


def _write_column(group: h5py.Group, name: str, data: NDArray[np.generic]) -> None:
    """Shuffled and deflated outside of HDF5: the spray of a nozzle takes 0.3 MB, and a millisecond."""
    packed = {"chunks": data.shape, "compression": "gzip", "compression_opts": 1, "shuffle": data.itemsize > 1}
    dataset = group.create_dataset(name, data.shape, data.dtype, **(packed if data.size else {}))
    dataset.attrs["units"] = _UNITS[name]
    if data.size:
        dataset.id.write_direct_chunk((0,) * data.ndim, encode_frame(data).chunk)


def _column(group: h5py.Group, name: str) -> Any:
    data = group[name][()]
    return data if data.dtype == np.uint8 else data.astype(np.float64)


def _camera(group: h5py.Group) -> PinholeCamera:
    values = {field.name: group[field.name][()] for field in fields(PinholeCamera)}
    width_px, height_px = values.pop("image_size_px")
    tilt_x_rad, tilt_y_rad = values.pop("tilt_rad")
    return PinholeCamera(
        **values, image_size_px=(int(width_px), int(height_px)), tilt_rad=(float(tilt_x_rad), float(tilt_y_rad))
    )
