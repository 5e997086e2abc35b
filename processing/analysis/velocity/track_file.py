"""Tracks of a series in an HDF5 file: 1-D columns, a row per droplet on a track."""

import json
from collections.abc import Mapping
from pathlib import Path

import h5py

from daq.files.atomic_file import replacing
from processing.analysis.droplets.droplet_file import PROVENANCE, Value, unit_of
from processing.analysis.velocity.track_table import DropletTracks

SCHEMA, SCHEMA_VERSION = "tomoshadow/tracks", 1
GROUP = "tracks"


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
        told["doubts"] = json.dumps(tracks.doubts)
        file.create_group(PROVENANCE).attrs.update({**provenance, **told})
