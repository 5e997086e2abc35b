"""CalibrationStore: the calibration files of one rig, and which of them is current."""

import json
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from daq.files.atomic_file import own_part_path, replacing
from daq.files.storage import storing
from daq.frozen_model import FrozenModel
from daq.names import is_identifier
from server.lab.errors import Damaged, NotFound

_CURRENT = "current"


class CalibrationSummary(FrozenModel):
    """One calibration in a list."""

    id: Annotated[str, Field(description="name of its file, without the ending")]
    current: Annotated[bool, Field(description="it is used for runs that name none")]


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
        """File of a calibration, whether it exists or not; NotFound for what is no id and could lead elsewhere."""
        if not is_identifier(calibration_id):
            raise NotFound(f"there is no calibration {calibration_id!r}")
        return self._folder / f"{calibration_id}.json"

    def list(self) -> list[CalibrationSummary]:
        """All calibrations, newest first."""
        current = self.current
        files = [path for path in self._folder.glob("*.json") if is_identifier(path.stem)]
        files.sort(key=_time_ns, reverse=True)
        return [CalibrationSummary(id=path.stem, current=path.stem == current) for path in files]

    def document(self, calibration_id: str) -> dict[str, Any]:
        """The calibration as it is stored; NotFound if there is none, Damaged if it is no JSON."""
        path = self.path(calibration_id)
        try:
            document = json.loads(path.read_text())
        except FileNotFoundError as error:
            raise NotFound(f"there is no calibration {calibration_id!r}") from error
        except (OSError, ValueError) as error:
            raise Damaged(f"{path}: cannot be read: {error}") from error
        if not isinstance(document, dict):
            raise Damaged(f"{path}: is no calibration")
        return document

    def content_id(self, calibration_id: str) -> str:
        """Hash of what a calibration says, which another file of its name has not; empty where nobody can read it."""
        try:
            return str(self.document(calibration_id).get("id", ""))
        except (NotFound, Damaged):
            return ""

    def image_sizes_px(self, calibration_id: str) -> dict[str, tuple[int, int]]:
        """(width, height) of the images of each view that a calibration is made for; those that can be read."""
        try:
            views = self.document(calibration_id).get("views", {})
            return {view: tuple(one["mapping"]["image_size_px"]) for view, one in views.items()}
        except (NotFound, Damaged, AttributeError, KeyError, TypeError):
            return {}

    def picture_folder(self, calibration_id: str) -> Path:
        """Where pictures of a calibration are, whether there are any or not."""
        return self._folder / "pictures" / self.path(calibration_id).stem

    def pictures(self, calibration_id: str) -> tuple[str, ...]:
        """Names of the pictures of a calibration."""
        return tuple(sorted(path.stem for path in self.picture_folder(calibration_id).glob("*.png")))

    def made_s(self, calibration_id: str) -> float | None:
        """When its file was written, Unix time; None if there is none."""
        return _time_ns(self.path(calibration_id)) / 1e9 or None

    @property
    def current(self) -> str | None:
        """Id of the calibration for runs that name none; None where none was chosen, or nobody can read which."""
        try:
            chosen = (self._folder / _CURRENT).read_text().strip()
        except (OSError, ValueError):
            return None
        return chosen if is_identifier(chosen) else None

    def choose(self, calibration_id: str) -> None:
        """Make a calibration the current one.

        Raises
        ------
        NotFound, Damaged
            There is none, or it cannot be read.
        StorageError
            The disk takes no note of it.
        """
        self.document(calibration_id)
        current = self._folder / _CURRENT
        with storing(self._folder), replacing(current, own_part_path(current)) as part:
            part.write_text(calibration_id + "\n")


def _time_ns(path: Path) -> int:
    """When a file was written; long ago if it has gone meanwhile."""
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0
