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
from processing.analysis.seal import SEAL, seal_of
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

    It is sealed with a hash of all that is written, by which ``read_tracks`` knows a file that was edited.

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
        kept = {**provenance, **told}
        file.create_group(PROVENANCE).attrs.update(
            {**kept, SEAL: seal_of({GROUP: {"": tracks.columns}}, _sealed(kept))}
        )


def _sealed(provenance: Mapping[str, Value]) -> dict[str, Value]:
    """What of it a seal holds: all but how the file is laid out."""
    return {name: value for name, value in provenance.items() if name not in SCHEMA_KEYS}


def read_tracks(path: str | Path) -> StoredTracks:
    """Read a file of ``tomoshadow tracks``.

    Parameters
    ----------
    path : path
        The file, ``*.h5``.

    Raises
    ------
    DropletFileError
        The file is missing, truncated, not of tracks, or was edited later. Files of older programs have no seal: edited
        ones are not known.
    """
    try:
        with h5py.File(path, "r") as file:
            columns = {name: column[:] for name, column in file[GROUP].items()}
            attributes = dict(file[PROVENANCE].attrs)
    except (OSError, KeyError, ValueError) as error:
        raise DropletFileError(f"{path}: not a readable file of tracks: {error}") from error
    plain = {name: value.item() if isinstance(value, np.generic) else value for name, value in attributes.items()}
    provenance = _sealed(plain)
    if provenance.pop(SEAL, None) not in (None, seal_of({GROUP: {"": columns}}, provenance)):
        raise DropletFileError(f"{path}: was changed after its droplets had been linked: make the tracks again")
    return StoredTracks(columns, provenance)
