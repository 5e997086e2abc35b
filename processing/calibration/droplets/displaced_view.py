"""A view that has moved further than a disparity can be measured: all others still agree without it."""

from collections.abc import Sequence

import numpy as np

from processing.calibration.droplets.disparity import MIN_DROPLETS, MIN_VIEWS, SEARCH_PX, local_disparities
from processing.calibration.droplets.droplet_matching import Box, match_exposures
from processing.geometry import FloatArray, ViewMapping

IN_PLACE_PX = 1.0
"""Views that disagree by less are in place among each other."""
EXPECTED_DROPLETS = 5 * MIN_DROPLETS
"""So many must be expected to agree in all views, were these in place, before their silence is an alarm."""
MANY_DROPLETS = 300
"""So many in one exposure tell enough; more would only take longer."""


def displaced_view(mappings: Sequence[ViewMapping], exposures: Sequence[Sequence[FloatArray]], box: Box) -> int | None:
    """Number of the view without which all others agree; None where it is not one alone, or droplets are too few.

    Parameters
    ----------
    mappings : sequence of ViewMapping
        The views as calibrated; of three none can be found, as two agree on nearly everything.
    exposures : sequence of sequences of (N, 2) arrays
        By exposure: the droplets of each view, in px.
    box : Box
        The measured volume.
    """
    if len(mappings) <= MIN_VIEWS:
        return None
    exposures = _enough(exposures)
    agreed = [_agreed_without(view, mappings, exposures, box) for view in range(len(mappings))]
    displaced = np.flatnonzero(agreed)
    if len(displaced) != 1 or _expected(int(displaced[0]), agreed[displaced[0]], exposures) < EXPECTED_DROPLETS:
        return None
    return int(displaced[0])


def _enough(exposures: Sequence[Sequence[FloatArray]]) -> Sequence[Sequence[FloatArray]]:
    """The first exposure, if its droplets are many."""
    return exposures[:1] if min(_counts(exposures[:1]), default=0) >= MANY_DROPLETS else exposures


def _agreed_without(
    view: int, mappings: Sequence[ViewMapping], exposures: Sequence[Sequence[FloatArray]], box: Box
) -> int:
    """Droplets that all other views agree on, without having moved among each other."""
    others = [mapping for number, mapping in enumerate(mappings) if number != view]
    seen = [[droplets for number, droplets in enumerate(exposure) if number != view] for exposure in exposures]
    found = local_disparities(others, match_exposures(others, seen, box, SEARCH_PX), box, (1, 1, 1))
    return sum(one.n_droplets for one in found if np.linalg.norm(one.disparity_px, axis=1).max() < IN_PLACE_PX)


def _expected(view: int, agreed: int, exposures: Sequence[Sequence[FloatArray]]) -> float:
    """Droplets that this view would agree on too: it hides as many of them as one of the others does."""
    counts = _counts(exposures)
    fewest = min(count for number, count in enumerate(counts) if number != view)
    return agreed * (agreed / fewest) * min(1.0, counts[view] / fewest)


def _counts(exposures: Sequence[Sequence[FloatArray]]) -> list[int]:
    """Droplets of each view in all exposures."""
    return [sum(map(len, seen)) for seen in zip(*exposures, strict=True)]
