"""The chapter on the shots: exposure by exposure how well it was explained, how many droplets are ghosts, and why."""

from collections.abc import Iterator, Sequence

import numpy as np

from processing.analysis.droplets.droplet_file import DIAMETER, FRAME, StoredDroplets
from processing.analysis.droplets.droplet_statistics import P_REAL
from processing.analysis.droplets.ghost_share import told_share
from processing.analysis.estimates import Estimate
from processing.figures.shots_figure import JudgedExposure, shots_figure
from server.reports.page import Picture, Section, Table

SHOT_HEAD = ("run", "shot", "exposure", "residual / noise", "hidden [%]", "verdict", "reasons")
VERDICT = SHOT_HEAD.index("verdict")
FEWEST_DRAWN = 3
"""Exposures: of fewer the table says all."""
CAPTION = (
    "What droplets do not explain of each exposure, over the noise: 1 where they explain all. Where it is told of one: "
    "ghosts that are expected among its droplets, with 95 % intervals."
)


def shots_section(shots: Sequence[StoredDroplets]) -> Section:
    """A table, and a picture where several exposures were fitted."""
    text = "Refused exposures have no droplets and do not count."
    judged = [one for shot in shots for one in _judged(shot)]
    fitted = sum(one.residual_over_noise is not None for one in judged)
    pictures = [Picture(shots_figure(judged), CAPTION, svg=True)] if fitted >= FEWEST_DRAWN else []
    return Section("Shots", text, [Table(SHOT_HEAD, exposure_rows(shots), words=True)], pictures)


def exposure_rows(shots: Sequence[StoredDroplets]) -> list[list[str]]:
    """A row for each exposure."""
    return [row for shot in shots for row in _rows(shot)]


def _judged(shot: StoredDroplets) -> Iterator[JudgedExposure]:
    for frame, one in shot.exposures.items():
        yield JudgedExposure(one["verdict"], one.get("residual_over_noise"), _ghosts(shot, frame))


def _ghosts(shot: StoredDroplets, frame: str) -> Estimate | None:
    if P_REAL not in shot.columns:
        return None
    own = shot.columns[FRAME].astype("U1") == frame
    share = told_share(np.asarray(shot.columns[P_REAL], np.float64)[own], DIAMETER in shot.columns)
    return share if isinstance(share, Estimate) else None


def _rows(shot: StoredDroplets) -> list[list[str]]:
    return [
        [
            str(shot.provenance.get("run", "")),
            str(shot.provenance.get("shot", "")),
            frame.upper(),
            "" if one.get("residual_over_noise") is None else f"{one['residual_over_noise']:.2f}",
            f"{100 * one.get('hidden', {}).get('volume_share', 0):.1f}",
            one["verdict"],
            "; ".join(one.get("reasons", ())),
        ]
        for frame, one in shot.exposures.items()
    ]
