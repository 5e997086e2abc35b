"""Droplets or tracks as CSV (RFC 4180): names with units, then a row per droplet; what is no number is empty.

What has no droplet, a whole shot or one of its exposures, has a row without numbers, which tells its verdict.
"""

import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from daq.files.atomic_file import replacing
from processing.analysis.exports.shot_table import shot_table, told_without_rows
from processing.analysis.exports.stored import Stored


def write_csv(path: Path, stored: Stored) -> None:
    """Write a table; numbers have all digits that tell them apart, and a point, whatever the country.

    Parameters
    ----------
    path : Path
        Usually ``*.csv``; an existing file is replaced.
    stored : Stored
        Droplets of a shot, or tracks.
    """
    table = shot_table(stored)
    with replacing(path) as part, part.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(table)
        writer.writerows(zip(*map(_cells, table.values()), strict=True))
        writer.writerows([cells.get(name, "") for name in table] for cells in told_without_rows(stored))


def _cells(column: NDArray[np.generic]) -> list[object]:
    values: list[object] = column.tolist()
    return ["" if isinstance(value, float) and np.isnan(value) else value for value in values]
