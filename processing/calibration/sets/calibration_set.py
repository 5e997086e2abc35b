"""Calibration sets on disk: a recorded calibration run, or a folder of imported images and measured points.

::

    SET/set.json     target, planes and points; paths relative to SET
    SET/images/...   the images as they came
    SET/points/...   the tables of measured points as they came
"""

from collections.abc import Sequence
from pathlib import Path

from pydantic import ValidationError

from processing.calibration.errors import CalibrationError
from processing.calibration.observation import CalibrationSet
from processing.calibration.sets.imported_set import detect_imported
from processing.calibration.sets.recorded_set import NO_ORIGINS, NO_ROLLS, Origins, Rolls, detect_recorded
from processing.calibration.sets.set_record import CalibrationEntry, SetRecord
from processing.progress import Counted, in_silence

SET_FILE = "set.json"


def load_calibration_set(
    path: Path,
    origins: Origins = NO_ORIGINS,
    rolls_deg: Rolls = NO_ROLLS,
    mirrored: Sequence[str] = (),
    counted: Counted = in_silence,
) -> CalibrationSet:
    """Detect the target in a recorded calibration run or in an imported set.

    Parameters
    ----------
    path : Path
        Run directory, set directory, or the directory of an import that holds a set.
    origins : mapping of (view, z_mm) to (u, v)
        Where views of a run see the target's origin, roughly; needed where no image shows the whole target.
        An imported set states them itself.
    rolls_deg : mapping of view to angle
        How cameras of a run are turned about their axes, where its configuration does not say so. Likewise.
    mirrored : sequence of views
        Those of a run that look by a mirror. Likewise.
    counted : Counted
        Told of the images in which the target is looked for.

    Raises
    ------
    CalibrationError
        The path is neither, a view never sees the target, or an origin, a roll or a mirror is stated where it cannot
        be; names the file.
    """
    path = Path(path)
    folder = next((one for one in (path, path / "calibration") if (one / SET_FILE).exists()), None)
    if folder is not None and (origins or rolls_deg or mirrored):
        raise CalibrationError(
            f"{folder / SET_FILE}: an imported set states its origins, rolls and mirrors itself "
            "(origin_px, roll_deg, mirrored)"
        )
    if folder is not None:
        return _read_imported(folder, counted)
    if (path / "run.h5").exists():
        return detect_recorded(path, origins, rolls_deg, mirrored, counted)
    raise CalibrationError(f"{path}: neither a calibration run (run.h5) nor a calibration set ({SET_FILE})")


def write_set_file(folder: Path, source: str, calibration: CalibrationEntry) -> None:
    """Write ``set.json``; all paths in it are relative to the folder."""
    record = SetRecord(source=source, calibration=calibration)
    (folder / SET_FILE).write_text(record.model_dump_json(indent=2, by_alias=True) + "\n", encoding="utf-8")


def _read_imported(folder: Path, counted: Counted) -> CalibrationSet:
    file = folder / SET_FILE
    try:
        record = SetRecord.model_validate_json(file.read_bytes())
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "text"
        raise CalibrationError(f"{file}: {where}: {first['msg']}") from error
    return detect_imported(record.source, record.calibration, folder, counted)
