"""The mean of volumes on the disk; those that have no common mean are refused."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from processing.analysis.stored_json import stored_json
from processing.preprocessing import Intensity
from processing.reconstruction.volume_file import StoredVolume, VolumeFileError, open_volume
from processing.runs.results_file import LATER_FIELDS, Provenance, volume_path
from processing.runs.stored_exposures import StoredExposure
from processing.volume import VoxelGrid

COPIED_PLANES = 8
"""Every so many planes are asked whether a volume is a copy: noise never repeats."""


@dataclass(frozen=True, eq=False)
class StoredAverage:
    """The mean of stored volumes.

    Parameters
    ----------
    mean : (z, y, x) float32 array
        Intensities.
    grid : VoxelGrid
        Where its voxels lie.
    exposures : tuple of StoredExposure
        What each of the volumes tells.
    copies : mapping of Path to StoredExposure
        By file, the volume before it that has its very voxels; of empty ones nothing is said: they are all alike.
    """

    mean: Intensity
    grid: VoxelGrid
    exposures: tuple[StoredExposure, ...]
    copies: Mapping[Path, StoredExposure]


def average_volumes(files: list[Path]) -> StoredAverage:
    """Mean of volumes on one grid.

    Raises
    ------
    VolumeFileError
        There are none, their runs, grids, calibrations or settings differ, two are of one exposure, or one was
        renamed or changed.
    """
    if not files:
        raise VolumeFileError("there are no volumes to average")
    with open_volume(files[0]) as first:
        grid, made_by = first.grid, _made_by(first.provenance)
    total = np.zeros(grid.shape, np.float32)
    counted: dict[str, Path] = {}
    exposures: list[StoredExposure] = []
    seen: dict[bytes, StoredExposure] = {}
    copies: dict[Path, StoredExposure] = {}
    for file in files:
        with open_volume(file) as volume:
            if volume.grid != grid:
                raise VolumeFileError(f"{file}: its grid {volume.grid} differs from {grid}, that of {files[0].name}")
            if differing := _differing(_made_by(volume.provenance), made_by):
                raise VolumeFileError(f"{file}: {differing} of {files[0].name}; these have no common mean")
            if (first_file := counted.setdefault(_exposure(volume.provenance) or str(file), file)) != file:
                raise VolumeFileError(f"{file}: the same exposure as {first_file.name}; it would count twice")
            if (called := _own_name(volume.provenance)) not in ("", file.name):
                raise VolumeFileError(f"{file}: was renamed, and is {called}: another shot, or another exposure")
            exposures.append(exposure := StoredExposure.of(volume))
            if (voxels := _added(volume, total)) and (first_seen := seen.setdefault(voxels, exposure)) is not exposure:
                copies[file] = first_seen
    total /= np.float32(len(files))
    return StoredAverage(total, grid, tuple(exposures), copies)


def _added(volume: StoredVolume, total: Intensity) -> bytes:
    """Add a volume to a sum; a hash of some of its planes, empty where nothing is in them."""
    voxels, empty = hashlib.blake2b(), True
    for first_row, slab in volume.slabs():
        if not np.isfinite(slab).all():
            raise VolumeFileError(f"{volume.path}: was changed: a voxel is infinite, or not a number")
        if slab.min(initial=0) < 0:
            raise VolumeFileError(f"{volume.path}: was changed: a voxel is negative")
        total[:, first_row : first_row + slab.shape[1]] += slab
        asked = slab[::COPIED_PLANES]
        voxels.update(asked.tobytes())
        empty = empty and not asked.any()
    return b"" if empty else voxels.digest()


def _exposure(provenance: Provenance) -> str:
    """Run, shot and frame of a volume; empty where it does not say."""
    names = ("run", "shot", "frame")
    return (
        ", ".join(f"{name} {provenance[name]}" for name in names) if all(name in provenance for name in names) else ""
    )


def _own_name(provenance: Provenance) -> str:
    """How the file of a volume was called; empty where it does not say."""
    if not _exposure(provenance):
        return ""
    return volume_path(Path(), int(provenance["shot"]), "a" if provenance["frame"] == "a" else "b").name


def _made_by(provenance: Provenance) -> dict[str, object]:
    """Run, calibration, version of the methods, and settings of a volume, one by one. Its grid speaks for itself."""
    settings = stored_json(provenance, "settings")
    settings.pop("grid", None)
    told = {name: provenance.get(name) for name in ("run", *LATER_FIELDS, "calibration")}
    return {**told, "method_version": provenance.get("method_version", 1), **settings}


def _differing(its: Mapping[str, object], others: Mapping[str, object]) -> str:
    """What is not the same, for a person; empty where all is."""
    names = [name for name in {**its, **others} if its.get(name) != others.get(name)]
    names = [name for name in names if name not in LATER_FIELDS or None not in (its.get(name), others.get(name))]
    return ", ".join(f"{name} {its.get(name)} instead of {others.get(name)}" for name in names)
