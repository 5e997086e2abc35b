"""Calibration files: versioned JSON that a person can read, with the errors inside. Round trips are exact."""

import hashlib
import json
import os
from importlib.metadata import version
from pathlib import Path

from pydantic import ValidationError

from processing.calibration.calibration import Calibration
from processing.calibration.calibration_record import (
    SCHEMA,
    VERSION,
    CalibrationRecord,
    from_record,
    json_id,
    to_json,
    to_record,
)
from processing.calibration.errors import CalibrationError

_SOFTWARE = ("tomoshadow", "numpy", "scipy", "opencv-contrib-python-headless")


def save_calibration(calibration: Calibration, path: str | Path, *, overwrite: bool = False) -> None:
    """Write a calibration file, JSON that a person can read; it appears whole or not at all.

    Parameters
    ----------
    calibration : Calibration
        What ``calibrate`` found.
    path : path
        Usually ``*.json``.
    overwrite : bool
        Replace a file that exists.

    Raises
    ------
    CalibrationError
        The file exists, and nobody asked to replace it.
    """
    path = Path(path)
    record = to_record(calibration, {package: version(package) for package in _SOFTWARE})
    text = _readable(to_json(record))
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    part.write_text(text, encoding="utf-8")
    try:
        if overwrite:
            part.replace(path)
        else:
            _publish(part, path)
    except FileExistsError as error:
        raise _exists(path) from error
    finally:
        part.unlink(missing_ok=True)


def _publish(part: Path, path: Path) -> None:
    """Give a file its name unless that is taken; a disk without hard links (FAT) has the name claimed first."""
    try:
        os.link(part, path)
    except FileExistsError:
        raise
    except OSError:
        path.open("x").close()
        part.replace(path)


def _exists(path: Path) -> CalibrationError:
    return CalibrationError(f"{path}: exists; a calibration is not overwritten unless asked to")


def load_calibration(path: str | Path) -> Calibration:
    """Read a calibration file.

    Parameters
    ----------
    path : path
        The file, of this version of the program or an older one.

    Raises
    ------
    CalibrationError
        The file is missing, damaged, of another version, or was changed by hand; names file and field.
    """
    path = Path(path)
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise CalibrationError(f"{path}: {error.strerror}") from error
    except ValueError as error:
        raise CalibrationError(f"{path}: not JSON: {error}") from error
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        raise CalibrationError(f"{path}: schema: not a calibration file ({SCHEMA!r} is missing)")
    if content.get("version") != VERSION:
        raise CalibrationError(f"{path}: version: {content.get('version')!r}, this program reads {VERSION}")
    try:
        calibration = from_record(CalibrationRecord.model_validate_json(json.dumps(content)))
    except ValidationError as error:
        raise CalibrationError(f"{path}: {_first_problem(error)}") from error
    if json_id(content) != calibration.id:
        raise CalibrationError(f"{path}: id: {calibration.id} does not belong to this content; the file was changed")
    return calibration


def file_sha256(path: Path) -> str:
    """Hash of a calibration file; runs and results keep it."""
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def _first_problem(error: ValidationError) -> str:
    first = error.errors()[0]
    text = "Extra inputs are not permitted" if first["type"] == "unexpected_keyword_argument" else first["msg"]
    return f"{'.'.join(str(part) for part in first['loc'])}: {text}"


def _readable(content: object, indent: int = 0) -> str:
    """JSON with one key per line; short lists and rows of numbers on one line."""
    pad = "  " * (indent + 1)
    compact = json.dumps(content)
    if isinstance(content, list) and all(isinstance(value, float) for value in content):
        return compact
    if len(compact) + len(pad) <= 118 and not (indent < 2 and isinstance(content, dict) and content):
        return compact
    if isinstance(content, dict):
        lines = [f"{pad}{json.dumps(key)}: {_readable(value, indent + 1)}" for key, value in content.items()]
        return "{\n" + ",\n".join(lines) + f"\n{pad[2:]}}}" + ("\n" if indent == 0 else "")
    if isinstance(content, list):
        lines = [f"{pad}{_readable(value, indent + 1)}" for value in content]
        return "[\n" + ",\n".join(lines) + f"\n{pad[2:]}]"
    return compact
