"""Droplets or tracks for Tecplot, and for readers of its format: an ASCII data file (Tecplot Data Format Guide).

Points lie in zones, value by value. A zone has a number of every variable in every row: rows that lack the same numbers
are a zone, whose title says which, and have ``NOTHING`` in their place. Passive variables would be the format's own
way, but readers of others do not know them; nor do they take a line of points that is written row by row (VTK, and
ParaView by it).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from daq.files.atomic_file import replacing
from processing.analysis.droplets.droplet_file import FRAME
from processing.analysis.droplets.droplet_table import Columns
from processing.analysis.exports.shot_table import SHOT, shot_table
from processing.analysis.exports.stored import Stored
from processing.analysis.exports.told_verdict import DOUBTFUL, doubtful, told_texts

POSITION = ("x_", "y_", "z_")
"""Names of variables that come first begin so: Tecplot takes them for the axes."""
STILL = ("run", "shot", "image")
"""Of what a file says of itself, in the title."""
NOTHING = -999.0
"""In the place of a number that is not known: no probability and no velocity of a spray is so low."""


@dataclass(frozen=True, eq=False)
class _Zone:
    """Rows of one exposure, or of one shot, that lack the same variables."""

    name: str
    time: float
    strand: int
    rows: NDArray[np.intp]
    told: dict[str, str]


def write_tecplot(path: Path, stored: Stored) -> None:
    """Write a zone per exposure, of tracks per shot; several files, or all shots of tracks, are a series in time.

    Parameters
    ----------
    path : Path
        Usually ``*.dat``; an existing file is replaced.
    stored : Stored
        Droplets of a shot, whose time is its number; or tracks, whose time is in seconds. What they are good for
        is auxiliary data of the file and of its zones, and the variable ``doubtful``.
    """
    columns = shot_table(stored)
    numbers = {name: column for name, column in columns.items() if column.dtype.kind not in "US"}
    numbers[DOUBTFUL] = doubtful(stored)
    ordered = {name: numbers[name] for name in sorted(numbers, key=lambda name: not name.startswith(POSITION))}
    still = {name: str(stored.provenance[name]) for name in STILL if name in stored.provenance}
    title = ", ".join(value if name == "run" else f"{name} {value}" for name, value in still.items())
    with replacing(path) as part, part.open("w", encoding="utf-8", newline="") as file:
        file.write(f'TITLE = "{_quotable(title)}"\n')
        file.write("VARIABLES = " + " ".join(f'"{name}"' for name in ordered) + "\n")
        file.writelines(_auxiliary("DATASETAUXDATA", told_texts(stored)))
        for zone in _zones(columns, ordered, stored):
            file.write(_head(zone))
            file.writelines(_auxiliary("AUXDATA", zone.told))
            file.writelines(_lines(zone, ordered))


def _zones(columns: Columns, ordered: Columns, stored: Stored) -> Iterator[_Zone]:
    """Exposures, or shots; of each the rows that lack the same numbers."""
    by = FRAME if FRAME in columns else SHOT
    lacking = np.column_stack([_is_no_number(column) for column in ordered.values()])
    patterns, of_row = np.unique(lacking, axis=0, return_inverse=True)
    keys = np.unique(columns[by])
    for number, key in enumerate(keys):
        told = told_texts(stored, str(key) if by == FRAME else "")
        for pattern, lacks in enumerate(patterns):
            rows = np.flatnonzero((columns[by] == key) & (of_row.ravel() == pattern))
            if len(rows):
                exposure = number if by == FRAME else 0
                strand = 1 + exposure * len(patterns) + pattern
                name = f"exposure {key}" if by == FRAME else f"shot {key}"
                without = ", ".join(np.array(list(ordered))[lacks])
                title = f"{name}, without {without}" if without else name
                yield _Zone(title, _time(stored, by, key), strand, rows, told)


def _is_no_number(column: NDArray[np.generic]) -> NDArray[np.bool_]:
    return np.isnan(column) if column.dtype.kind == "f" else np.zeros(len(column), bool)


def _time(stored: Stored, by: str, key: np.generic) -> float:
    if by == FRAME:
        shot = stored.provenance.get("shot", 0)
        return float(shot)
    return float(key.item()) / float(stored.provenance["rate_hz"])


def _head(zone: _Zone) -> str:
    """Zones are ordered where no type is stated; VTK reads those of a stated type row by row."""
    times = f"STRANDID={zone.strand} SOLUTIONTIME={zone.time!r}"
    return f'ZONE T="{_quotable(zone.name)}" {times} I={len(zone.rows)} DATAPACKING=BLOCK\n'


def _auxiliary(kind: str, texts: dict[str, str]) -> Iterator[str]:
    """A line per text, but for those that say nothing."""
    return (f'{kind} {name}="{_quotable(text)}"\n' for name, text in texts.items() if text)


def _lines(zone: _Zone, ordered: Columns) -> Iterator[str]:
    """A number each, variable by variable, with all digits that tell numbers apart; a longer line has no end."""
    for column in ordered.values():
        values = column[zone.rows]
        known = np.where(_is_no_number(values), NOTHING, values) if values.dtype.kind == "f" else values
        yield "".join(f"{number!r}\n" for number in known.tolist())


def _quotable(text: str) -> str:
    return text.replace('"', "'").replace("\n", " ")
