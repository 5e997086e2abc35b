"""Tracks of a series in an HDF5 file: 1-D columns, a row per droplet on a track."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from daq.files.atomic_file import replacing
from processing.analysis.droplets.droplet_file import PROVENANCE, SCHEMA_KEYS, DropletFileError, Value, unit_of
from processing.analysis.droplets.droplet_table import Columns
from processing.analysis.velocity.track_table import DropletTracks

SCHEMA, SCHEMA_VERSION = "tomoshadow/tracks", 1
GROUP = "tracks"


@dataclass(frozen=True, eq=False)
class StoredTracks:
    """Tracks as a file has them.

    Parameters
    ----------
    columns : dict of name to (N,) array
        A row per droplet on a track, track by track and shot by shot.
    provenance : dict
        Where they come from; ``rate_hz``, ``half_window`` and ``doubts``, a JSON list, among it.
    """

    columns: Columns
    provenance: dict[str, Value]


def write_tracks(path: Path, tracks: DropletTracks, provenance: Mapping[str, Value]) -> None:
    """Write the tracks of a series; the file appears whole or not at all, an old one is replaced.

    Parameters
    ----------
    path : Path
        Usually ``*.h5``.
    tracks : DropletTracks
        As ``track_droplets`` gives them.
    provenance : Mapping[str, str | int | float]
        Where they come from: kept as attributes of the group ``/tomoshadow``.
    """
    with replacing(path) as part, h5py.File(part, "w") as file:
        group = file.create_group(GROUP, track_order=True)
        for name, values in tracks.columns.items():
            group.create_dataset(name, data=values).attrs["units"] = unit_of(name)
        told: dict[str, Value] = {"schema": SCHEMA, "schema_version": SCHEMA_VERSION, "rate_hz": tracks.rate_hz}
        told |= {"half_window": tracks.half_window, "doubts": json.dumps(tracks.doubts)}
        file.create_group(PROVENANCE).attrs.update({**provenance, **told})


def read_tracks(path: str | Path) -> StoredTracks:
    """Read a file of ``tomoshadow tracks``.

    Parameters
    ----------
    path : path
        The file, ``*.h5``.

    Raises
    ------
    DropletFileError
        The file is missing, truncated, or not of tracks.
    """
    try:
        with h5py.File(path, "r") as file:
            columns = {name: column[:] for name, column in file[GROUP].items()}
            attributes = dict(file[PROVENANCE].attrs)
    except (OSError, KeyError, ValueError) as error:
        raise DropletFileError(f"{path}: not a readable file of tracks: {error}") from error
    plain = {name: value.item() if isinstance(value, np.generic) else value for name, value in attributes.items()}
    return StoredTracks(columns, {name: value for name, value in plain.items() if name not in SCHEMA_KEYS})
