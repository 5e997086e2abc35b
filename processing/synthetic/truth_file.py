"""truth.h5: what the simulated bench knows and a laboratory never does; kept beside a run, to judge results.

``/cameras/<view>`` holds the true camera models, ``/sprays/<sequence>`` the liquid of a firing at its first
light pulse. The key is the sequence number of the generator, which every shot records, and not the index of
the shot: a shot that was fired again has its own liquid.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path

import h5py
import numpy as np

from processing.geometry import PinholeCamera
from processing.synthetic.spray import Spray

SCHEMA = "tomoshadow.truth"
VERSION = 1

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


def write_truth(path: Path, cameras: Mapping[str, PinholeCamera], sprays: Mapping[int, FiredSpray]) -> None:
    """Write the truth of a run.

    Parameters
    ----------
    path : Path
        File to write; folders are made, an older file is replaced.
    cameras : mapping of view to PinholeCamera
        True camera models.
    sprays : mapping of sequence number to FiredSpray
        Liquid of each firing; empty for runs without spray.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with h5py.File(path, "w", libver=("v110", "v110")) as file:
        file.attrs.update(schema=SCHEMA, version=VERSION, axes="x, y, z in mm; y points down; right-handed")
        for view, camera in cameras.items():
            _write_fields(file.create_group(f"cameras/{view}"), camera)
        for sequence, fired in sprays.items():
            group = file.create_group(f"sprays/{sequence}")
            group.attrs["time_ns"] = fired.time_ns
            _write_fields(group, fired.spray)


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
    with _opened(path) as file:
        group = file.get(f"sprays/{sequence}")
        if group is None:
            raise TruthFileError(f"{path}: no spray of firing {sequence}")
        return FiredSpray(
            int(group.attrs["time_ns"]), Spray(**{field.name: group[field.name][()] for field in fields(Spray)})
        )


def _opened(path: Path) -> h5py.File:
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise TruthFileError(f"{path}: {error}") from error
    if file.attrs.get("schema") != SCHEMA or file.attrs.get("version") != VERSION:
        file.close()
        raise TruthFileError(f"{path}: not a {SCHEMA} file of version {VERSION}")
    return file


def _write_fields(group: h5py.Group, value: PinholeCamera | Spray) -> None:
    for field in fields(value):
        data = np.asarray(getattr(value, field.name))
        # Shuffled and deflated: a spray of 20 000 balls takes 0.6 MB.
        options = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if data.size > 1000 else {}
        group.create_dataset(field.name, data=data, **options).attrs["units"] = _UNITS[field.name]


def _camera(group: h5py.Group) -> PinholeCamera:
    values = {field.name: group[field.name][()] for field in fields(PinholeCamera)}
    width_px, height_px = values.pop("image_size_px")
    tilt_x_rad, tilt_y_rad = values.pop("tilt_rad")
    return PinholeCamera(
        **values, image_size_px=(int(width_px), int(height_px)), tilt_rad=(float(tilt_x_rad), float(tilt_y_rad))
    )
