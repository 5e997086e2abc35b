"""The columns of a file as tables of many files want them: the shot, or the image, in front; what is told, behind."""

import numpy as np

from processing.analysis.droplets.droplet_file import FRAME, Value
from processing.analysis.droplets.droplet_table import Columns
from processing.analysis.exports.stored import Stored
from processing.analysis.exports.told_verdict import told_columns, told_texts
from processing.analysis.stored_json import stored_json

TRACK, SHOT, IMAGE = "track", "shot", "image"


def told_without_rows(stored: Stored) -> list[dict[str, object]]:
    """Cells by column of rows without numbers: what is told of each exposure that has no rows, or of a file without."""
    return [{**_named(stored), **told} for told in _without_rows(stored)]


def _without_rows(stored: Stored) -> list[dict[str, str]]:
    frames = set(map(str, stored.columns.get(FRAME, ())))
    told = [frame for frame in stored_json(stored.provenance, "exposures") if frame not in frames]
    if told:
        return [{FRAME: frame, **told_texts(stored, frame)} for frame in told]
    return [] if len(next(iter(stored.columns.values()))) else [told_texts(stored)]


def _named(stored: Stored) -> dict[str, Value]:
    return {name: stored.provenance[name] for name in (SHOT, IMAGE) if name in stored.provenance}


def shot_table(stored: Stored) -> Columns:
    """Columns by name: ``shot`` or ``image``, if the file says which, those of the file, and what they are good for."""
    rows = len(next(iter(stored.columns.values())))
    return (
        {name: np.full(rows, value) for name, value in _named(stored).items()} | stored.columns | told_columns(stored)
    )
