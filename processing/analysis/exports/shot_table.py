"""The columns of a file as tables of many files want them: with the shot, or the image, in front."""

from typing import Protocol

import numpy as np

from processing.analysis.droplets.droplet_file import Value
from processing.analysis.droplets.droplet_table import Columns

TRACK, SHOT, IMAGE = "track", "shot", "image"


class Stored(Protocol):
    """A table as a file has it: droplets of a shot, or tracks of a series."""

    @property
    def columns(self) -> Columns:
        """By their names."""

    @property
    def provenance(self) -> dict[str, Value]:
        """Where they come from."""


def shot_table(stored: Stored) -> Columns:
    """Columns by name: ``shot`` or ``image``, if the file says which, and those of the file."""
    rows = len(next(iter(stored.columns.values())))
    named = {name: stored.provenance[name] for name in (SHOT, IMAGE) if name in stored.provenance}
    return {name: np.full(rows, value) for name, value in named.items()} | stored.columns
