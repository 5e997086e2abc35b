"""The columns of a shot as tables of many shots want them: with the shot in front."""

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.droplet_file import StoredDroplets


def shot_table(droplets: StoredDroplets) -> dict[str, NDArray[np.generic]]:
    """Columns by name: ``shot``, if the file says which, and those of the file."""
    columns = droplets.columns
    rows = len(next(iter(columns.values())))
    shot = droplets.provenance.get("shot")
    return ({} if shot is None else {"shot": np.full(rows, int(shot))}) | columns
