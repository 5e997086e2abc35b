"""The columns of a file as tables of many files want them: the shot, or the image, in front; what is told, behind."""

import numpy as np

from processing.analysis.droplets.droplet_table import Columns
from processing.analysis.exports.stored import Stored
from processing.analysis.exports.told_verdict import told_columns

TRACK, SHOT, IMAGE = "track", "shot", "image"


def shot_table(stored: Stored) -> Columns:
    """Columns by name: ``shot`` or ``image``, if the file says which, those of the file, and what they are good for."""
    rows = len(next(iter(stored.columns.values())))
    named = {name: stored.provenance[name] for name in (SHOT, IMAGE) if name in stored.provenance}
    return {name: np.full(rows, value) for name, value in named.items()} | stored.columns | told_columns(stored)
