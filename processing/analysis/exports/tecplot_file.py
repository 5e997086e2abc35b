"""Droplets or tracks for Tecplot: an ASCII data file (Tecplot Data Format Guide), points in zones.

A variable of a zone has a number in every row, or is passive and has none: rows that lack the same numbers are a zone.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from daq.files.atomic_file import replacing
from processing.analysis.droplets.droplet_file import FRAME
from processing.analysis.droplets.droplet_table import Columns
from processing.analysis.exports.shot_table import IMAGE, SHOT, Stored, shot_table

POSITION = ("x_", "y_", "z_")
"""Names of variables that come first begin so: Tecplot takes them for the axes."""
STILL = ("run", "shot", "image")
"""Of what a file says of itself, in the title."""


@dataclass(frozen=True, eq=False)
class _Zone:
    """Rows of one exposure, or of one shot, that lack the same variables."""

    name: str
    time: float
    strand: int
    rows: NDArray[np.intp]
    passive: NDArray[np.intp]


def write_tecplot(path: Path, stored: Stored) -> None:
    """Write a zone per exposure, of tracks per shot; several files, or all shots of tracks, are a series in time.

    Parameters
    ----------
    path : Path
        Usually ``*.dat``; an existing file is replaced.
    stored : Stored
        Droplets of a shot, whose time is its number; or tracks, whose time is in seconds.
    """
    columns = shot_table(stored)
    numbers = {name: column for name, column in columns.items() if name not in (FRAME, IMAGE)}
    ordered = {name: numbers[name] for name in sorted(numbers, key=lambda name: not name.startswith(POSITION))}
    title = ", ".join(str(stored.provenance[name]) for name in STILL if name in stored.provenance)
    with replacing(path) as part, part.open("w", encoding="utf-8", newline="") as file:
        file.write(f'TITLE = "{_quotable(title)}"\n')
        file.write("VARIABLES = " + " ".join(f'"{name}"' for name in ordered) + "\n")
        for zone in _zones(columns, ordered, stored):
            file.write(_head(zone))
            file.writelines(_lines(zone, ordered))


def _zones(columns: Columns, ordered: Columns, stored: Stored) -> Iterator[_Zone]:
    """Exposures, or shots; of each the rows that lack the same numbers."""
    by = FRAME if FRAME in columns else SHOT
    lacking = np.column_stack([_is_no_number(column) for column in ordered.values()])
    patterns, of_row = np.unique(lacking, axis=0, return_inverse=True)
    keys = np.unique(columns[by])
    for number, key in enumerate(keys):
        for pattern, passive in enumerate(patterns):
            rows = np.flatnonzero((columns[by] == key) & (of_row.ravel() == pattern))
            if len(rows):
                exposure = number if by == FRAME else 0
                strand = 1 + exposure * len(patterns) + pattern
                name = f"exposure {key}" if by == FRAME else f"shot {key}"
                yield _Zone(name, _time(stored, by, key), strand, rows, np.flatnonzero(passive))


def _is_no_number(column: NDArray[np.generic]) -> NDArray[np.bool_]:
    return np.isnan(column) if column.dtype.kind == "f" else np.zeros(len(column), bool)


def _time(stored: Stored, by: str, key: np.generic) -> float:
    if by == FRAME:
        shot = stored.provenance.get("shot", 0)
        return float(shot)
    return float(key.item()) / float(stored.provenance["rate_hz"])


def _head(zone: _Zone) -> str:
    passive = f" PASSIVEVARLIST=[{','.join(str(number + 1) for number in zone.passive)}]" if len(zone.passive) else ""
    times = f"STRANDID={zone.strand} SOLUTIONTIME={zone.time!r}"
    return f'ZONE T="{_quotable(zone.name)}" {times} I={len(zone.rows)} ZONETYPE=ORDERED DATAPACKING=POINT{passive}\n'


def _lines(zone: _Zone, ordered: Columns) -> Iterator[str]:
    """A row each, with all digits that tell numbers apart."""
    active = [column[zone.rows].tolist() for place, column in enumerate(ordered.values()) if place not in zone.passive]
    for row in zip(*active, strict=True):
        yield " ".join(map(repr, row)) + "\n"


def _quotable(text: str) -> str:
    return text.replace('"', "'").replace("\n", " ")
