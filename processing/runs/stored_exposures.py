"""What stored volumes tell of the exposures that they were made of: each file is read once, whoever asks."""

import json
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from processing.reconstruction.volume_file import StoredVolume, VolumeFileError, open_volume
from processing.runs.results_file import ExposureKey, Provenance


@dataclass(frozen=True, eq=False)
class StoredExposure:
    """All of a stored volume but its voxels.

    Parameters
    ----------
    file : Path
        The volume.
    provenance : Provenance
        Where it comes from, and what was wrong.
    lost_share : float
        Of the sum of all intensities, what was in voxels too faint for bytes.
    """

    file: Path
    provenance: Provenance
    lost_share: float

    @classmethod
    def of(cls, volume: StoredVolume) -> "StoredExposure":
        """What an open volume tells."""
        return cls(volume.path, volume.provenance, volume.lost_share)

    @property
    def key(self) -> ExposureKey:
        """Shot and exposure; KeyError where it does not say."""
        return int(self.provenance["shot"]), "b" if self.provenance["frame"] == "b" else "a"

    @property
    def shot(self) -> str | int | float:
        """Index of its shot; the name of a file that does not say."""
        return self.provenance.get("shot", self.file.name)

    def table(self, name: str) -> Any:
        """What it keeps as a JSON table; KeyError where it keeps none."""
        return json.loads(str(self.provenance[name]))


def stored_exposures(volume_files: Iterable[Path]) -> list[StoredExposure]:
    """Of all volumes that can be read."""
    found = []
    for file in volume_files:
        with suppress(VolumeFileError), open_volume(file) as volume:
            found.append(StoredExposure.of(volume))
    return found
