"""The columns of a shot as tables of many shots want them: with the shot, or the image, in front."""

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.droplet_file import StoredDroplets


def shot_table(droplets: StoredDroplets) -> dict[str, NDArray[np.generic]]:
    """Columns by name: ``shot`` or ``image``, if the file says which, and those of the file."""
    columns = droplets.columns
    rows = len(next(iter(columns.values())))
    named = {name: droplets.provenance[name] for name in ("shot", "image") if name in droplets.provenance}
    return {name: np.full(rows, value) for name, value in named.items()} | columns
