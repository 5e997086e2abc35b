"""A reader of Tecplot's ASCII data files, as its Data Format Guide has them: ordered zones of points."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from processing.geometry import FloatArray


@dataclass(frozen=True, eq=False)
class Zone:
    """A zone; variables that are passive in it are not numbers."""

    title: str
    time: float
    strand: int
    rows: FloatArray


def tecplot_zones(path: Path) -> tuple[str, list[str], list[Zone]]:
    """Title, names of the variables, and zones of a file."""
    title, variables, *lines = path.read_text(encoding="utf-8").splitlines()
    names = re.findall(r'"([^"]*)"', variables.removeprefix("VARIABLES ="))
    zones = []
    while lines:
        head = lines.pop(0)
        said = dict(re.findall(r"(\w+)=(\[[^]]*\]|\"[^\"]*\"|\S+)", head.removeprefix("ZONE ")))
        assert (said["DATAPACKING"], said["ZONETYPE"]) == ("POINT", "ORDERED")
        passive = [int(one) - 1 for one in said.get("PASSIVEVARLIST", "[]").strip("[]").split(",") if one]
        active = [number for number in range(len(names)) if number not in passive]
        rows = np.full((int(said["I"]), len(names)), np.nan)
        for row in rows:
            row[active] = [float(number) for number in lines.pop(0).split()]
        zones.append(Zone(said["T"].strip('"'), float(said["SOLUTIONTIME"]), int(said["STRANDID"]), rows))
    return re.findall(r'"([^"]*)"', title)[0], names, zones
