"""Stored: a table as a file has it, whatever its rows are."""

from typing import Protocol

from processing.analysis.droplets.droplet_file import Value
from processing.analysis.droplets.droplet_table import Columns


class Stored(Protocol):
    """Droplets of a shot, or tracks of a series."""

    @property
    def columns(self) -> Columns:
        """By their names."""

    @property
    def provenance(self) -> dict[str, Value]:
        """Where they come from."""
