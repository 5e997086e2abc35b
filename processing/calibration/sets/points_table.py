"""Tables of measured points, as spreadsheets and other programs write them: text, a point per line."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from processing.calibration.errors import CalibrationError
from processing.geometry import FloatArray

Table = dict[str, FloatArray]
"""Values (N,) by column."""

_COMMA = re.compile(r"\d,\d")
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?|[-+]?(nan|inf|infinity)", re.ASCII | re.IGNORECASE)
"""As spreadsheets write it: ``float`` alone would take 1_0 for ten."""


def read_table(path: Path, columns: Sequence[str]) -> Table:
    """Columns of a table of numbers, separated by blanks, tabs, commas or semicolons; # starts a comment.

    Raises
    ------
    CalibrationError
        The file is missing, is no text, or a line does not have these columns; names file and line.
    """
    rows: list[list[float | None]] = []
    for number, line in enumerate(_lines(path), start=1):
        text = line.split("#")[0]
        fields = text.replace(",", " ").replace(";", " ").split()
        if not fields:
            continue
        values = [_number(field) for field in fields]
        if problem := _problem(text, fields, values, columns, first=not rows):
            raise CalibrationError(f"{path}, line {number}: {problem}")
        rows.append(values)
    if not rows:
        raise CalibrationError(f"{path}: no points in it")
    return dict(zip(columns, np.array(rows, dtype=np.float64).T, strict=True))


def _lines(path: Path) -> list[str]:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise CalibrationError(f"{path}: {error.strerror}") from error
    if b"\0" in content:
        raise CalibrationError(f"{path}: not a table in plain text (UTF-8): it has zero bytes, as UTF-16 and images do")
    return content.decode("utf-8-sig", errors="replace").splitlines()


def _number(field: str) -> float | None:
    return float(field) if _NUMBER.fullmatch(field) else None


def _problem(
    text: str, fields: Sequence[str], values: Sequence[float | None], columns: Sequence[str], *, first: bool
) -> str | None:
    """What is wrong with a line; None where nothing is."""
    wrong = [field for field, value in zip(fields, values, strict=True) if value is None]
    if first and len(wrong) == len(fields):
        return f"{text.strip()!r}: a header line? Begin it with #, or take it out"
    if _has_decimal_commas(text, columns):
        return f"{text.strip()!r}: decimal commas? Write points"
    if len(fields) != len(columns):
        return f"{len(fields)} values, columns are {', '.join(columns)}"
    if wrong:
        return f"{', '.join(wrong)}: not a number"
    if not np.isfinite(np.array(values, dtype=np.float64)).all():
        return f"{', '.join(fields)}: values must be finite"
    return None


def _has_decimal_commas(text: str, columns: Sequence[str]) -> bool:
    """Whether there are as many values as columns if commas are points; or twice as many, where commas do both."""
    apart = text.replace(";", " ").split()
    with_points = len(apart) == len(columns) and all(_number(field.replace(",", ".")) is not None for field in apart)
    return bool(_COMMA.search(text)) and (with_points or len(text.split(",")) == 2 * len(columns))
