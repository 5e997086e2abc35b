"""PortLink: the path of a serial port that stays the same, whatever is plugged in there; udev makes such links."""

import shutil
import tempfile
from pathlib import Path


class PortLink:
    """A symbolic link in a folder of its own, which exists from the first plugging in to ``remove``.

    Parameters
    ----------
    name : str
        Last part of the path.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._folder: Path | None = None

    @property
    def path(self) -> str:
        """What a driver opens; empty before anything was plugged in."""
        return "" if self._folder is None else str(self._folder / self._name)

    def lead_to(self, device: str) -> None:
        """Something is plugged in: the path leads to its device."""
        self.lead_nowhere()
        if self._folder is None:
            self._folder = Path(tempfile.mkdtemp(prefix="tomoshadow-port-"))
        Path(self.path).symlink_to(device)

    def lead_nowhere(self) -> None:
        """Nothing is plugged in: the path does not exist."""
        if self._folder is not None:
            Path(self.path).unlink(missing_ok=True)

    def remove(self) -> None:
        """Remove link and folder; safe to call twice."""
        folder, self._folder = self._folder, None
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)
