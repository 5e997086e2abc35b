"""A reader of Tecplot's ASCII data files, as its Data Format Guide has them: ordered zones of points, in blocks."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from processing.geometry import FloatArray

LONGEST_LINE = 32_000
"""Characters that a line may have."""


@dataclass(frozen=True, eq=False)
class Zone:
    """A zone, with its auxiliary data."""

    title: str
    time: float
    strand: int
    told: dict[str, str]
    rows: FloatArray


def tecplot_zones(path: Path) -> tuple[str, list[str], list[Zone], dict[str, str]]:
    """Title, names of the variables, zones, and auxiliary data of a file."""
    title, variables, *lines = path.read_text(encoding="utf-8").splitlines()
    assert max(map(len, lines), default=0) < LONGEST_LINE
    names = re.findall(r'"([^"]*)"', variables.removeprefix("VARIABLES ="))
    told, zones = _auxiliary("DATASETAUXDATA", lines), []
    while lines:
        head = lines.pop(0)
        said = dict(re.findall(r"(\w+)=(\"[^\"]*\"|\S+)", head.removeprefix("ZONE ")))
        assert said.keys() == {"T", "STRANDID", "SOLUTIONTIME", "I", "DATAPACKING"}, "all others are as by default"
        assert said["DATAPACKING"] == "BLOCK"
        its, rows = _auxiliary("AUXDATA", lines), int(said["I"])
        numbers = [float(lines.pop(0)) for _ in range(rows * len(names))]
        block = np.array(numbers).reshape(len(names), rows).T
        zones.append(Zone(said["T"].strip('"'), float(said["SOLUTIONTIME"]), int(said["STRANDID"]), its, block))
    return re.findall(r'"([^"]*)"', title)[0], names, zones, told


def _auxiliary(kind: str, lines: list[str]) -> dict[str, str]:
    """Texts by their names, of the lines that come first."""
    told = {}
    while lines and (found := re.fullmatch(rf'{kind} (\w+)="([^"]*)"', lines[0])):
        told[found[1]] = found[2]
        lines.pop(0)
    return told
