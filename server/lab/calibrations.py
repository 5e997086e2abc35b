"""CalibrationStore: the calibration files of one rig, and which of them is current."""

import json
from pathlib import Path
from typing import Any

from daq.frozen_model import FrozenModel
from server.lab.errors import NotFound

_CURRENT = "current"


class CalibrationSummary(FrozenModel):
    """One calibration in a list."""

    id: str
    current: bool


class CalibrationStore:
    """Calibrations in one folder, ``<id>.json`` each; the file ``current`` names the one for new runs.

    Parameters
    ----------
    folder : Path
        Made if it does not exist.
    """

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder

    def path(self, calibration_id: str) -> Path:
        """File of a calibration, whether it exists or not."""
        return self._folder / f"{calibration_id}.json"

    def list(self) -> list[CalibrationSummary]:
        """All calibrations, newest first."""
        current = self.current
        files = sorted(self._folder.glob("*.json"), key=lambda path: path.stat().st_mtime_ns, reverse=True)
        return [CalibrationSummary(id=path.stem, current=path.stem == current) for path in files]

    def document(self, calibration_id: str) -> dict[str, Any]:
        """The calibration as it is stored; NotFound if there is none."""
        document: dict[str, Any] = json.loads(self._existing(calibration_id).read_text())
        return document

    @property
    def current(self) -> str | None:
        """Id of the calibration for runs that name none."""
        marker = self._folder / _CURRENT
        return marker.read_text().strip() if marker.exists() else None

    def choose(self, calibration_id: str) -> None:
        """Make a calibration the current one; NotFound if there is none."""
        self._existing(calibration_id)
        part = self._folder / f"{_CURRENT}.part"
        part.write_text(calibration_id + "\n")
        part.replace(self._folder / _CURRENT)

    def _existing(self, calibration_id: str) -> Path:
        path = self.path(calibration_id)
        if not path.is_file():
            raise NotFound(f"there is no calibration {calibration_id!r}")
        return path
