"""PortLink: the path of a serial port that stays the same, whatever is plugged in there; udev makes such links."""

import shutil
import tempfile
from pathlib import Path


class PortLink:
    """A symbolic link, which exists while something is plugged in.

    Parameters
    ----------
    name : str
        Last part of the path, in a folder of its own that exists from the first plugging in to ``remove``.
    path : Path | None
        The whole path instead, which outlives this process; what is left there of another one is replaced.
    """

    def __init__(self, name: str, path: Path | None = None) -> None:
        self._name = name
        self._path = path
        self._folder: Path | None = None

    @property
    def path(self) -> str:
        """What a driver opens; empty before anything was plugged in, unless it was given."""
        return "" if self._path is None else str(self._path)

    def lead_to(self, device: str) -> None:
        """Something is plugged in: the path leads to its device."""
        if self._path is None:
            self._folder = Path(tempfile.mkdtemp(prefix="tomoshadow-port-"))
            self._path = self._folder / self._name
        self.lead_nowhere()
        self._path.symlink_to(device)

    def lead_nowhere(self) -> None:
        """Nothing is plugged in: the path does not exist."""
        if self._path is not None:
            self._path.unlink(missing_ok=True)

    def remove(self) -> None:
        """Remove link and folder; safe to call twice."""
        self.lead_nowhere()
        folder, self._folder = self._folder, None
        if folder is not None:
            self._path = None
            shutil.rmtree(folder, ignore_errors=True)
