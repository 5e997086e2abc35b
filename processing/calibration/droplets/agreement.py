"""Views that see other droplets than all others: their lines of sight meet those of the others by chance alone.

Lines of sight of three views in place meet at every droplet that all of them see. How often they meet by chance, the
same droplets tell, their rows dealt out anew in the image of one view. No figure can be given here: such a view is
somewhere else.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from processing.calibration.droplets.droplet_matching import MAX_SEEDS, Box, match_exposures
from processing.geometry import FloatArray, ViewMapping

CLOSE_PX = 1.0
"""Lines of sight that pass a droplet so closely, in all images, meet there."""
DEALS = 4
"""How often rows are dealt out anew; the same ones every time."""
AGREED_SHARE = 0.2
"""Three views in place agree on a larger share of the droplets that one of them sees, beyond what chance makes."""
CERTAIN = 3.0
"""Standard deviations of that share."""

Exposures = Sequence[Sequence[FloatArray]]


def strangers(mappings: Sequence[ViewMapping], exposures: Exposures, box: Box) -> list[int]:
    """Numbers of the views that agree with no others although they would, beyond doubt, were they in place.

    Where it is not as certain that all others agree, any view may be the one: all are named.

    Parameters
    ----------
    mappings : sequence of ViewMapping
        The views as calibrated; of two, one cannot be told from the other, both are.
    exposures : sequence of sequences of (N, 2) arrays
        By exposure: the droplets of each view, in px.
    box : Box
        The measured volume.
    """
    everyone = set(range(len(mappings)))
    alone, agreed = set(everyone), set()
    for views in combinations(everyone, min(3, len(mappings))):
        seen = [[exposure[view] for view in views] for exposure in exposures]
        ranges = list(_shares([mappings[view] for view in views], seen, box))
        alone -= {view for view, (_, most) in zip(views, ranges, strict=True) if most >= AGREED_SHARE}
        agreed |= {view for view, (least, _) in zip(views, ranges, strict=True) if least >= AGREED_SHARE}
    return sorted(alone if alone | agreed == everyone or not alone else everyone)


def _shares(mappings: Sequence[ViewMapping], exposures: Exposures, box: Box) -> Iterator[tuple[float, float]]:
    """By view: the least and the largest share of its droplets that may be those of the others, beyond chance."""
    counts = [sum(min(len(droplets), MAX_SEEDS) for droplets in seen) for seen in zip(*exposures, strict=True)]
    met = _met(mappings, exposures, box)
    by_chance = _met_by_chance(mappings, exposures, box) if _may_agree(met, counts) else [0.0] * len(met)
    for count, number, chance in zip(counts, met, by_chance, strict=True):
        if count - chance < 1:
            yield 0.0, 1.0
            continue
        uncertainty = np.sqrt((number + 1) * (1 - number / (count + 1))) / (count - chance)
        share = (number - chance) / (count - chance)
        yield float(share - CERTAIN * uncertainty), float(share + CERTAIN * uncertainty)


def _may_agree(met: Sequence[int], counts: Sequence[int]) -> bool:
    """Enough of some view's droplets are met, even if none of them were by chance."""
    return any(
        number + CERTAIN * np.sqrt(number + 1) >= AGREED_SHARE * count
        for number, count in zip(met, counts, strict=True)
    )


def _met_by_chance(mappings: Sequence[ViewMapping], exposures: Exposures, box: Box) -> list[float]:
    dealt = [_met(mappings, _dealt(exposures, deal), box) for deal in range(DEALS)]
    return [float(np.mean(numbers)) for numbers in zip(*dealt, strict=True)]


def _met(mappings: Sequence[ViewMapping], exposures: Exposures, box: Box) -> list[int]:
    """How many droplets of each view lie where lines of sight of all views meet."""
    matches = match_exposures(mappings, exposures, box, CLOSE_PX)
    seen_px = [
        mapping.project(matches.points_mm) + left
        for mapping, left in zip(mappings, matches.disparities_px.swapaxes(0, 1), strict=True)
    ]
    return [len(np.unique(np.round(px, 3), axis=0)) for px in seen_px]


def _dealt(exposures: Exposures, deal: int) -> Exposures:
    """The same with the rows of the last view's droplets dealt out among them: as dense everywhere, and none right."""
    rng = np.random.default_rng(deal)
    return [[*seen[:-1], np.column_stack([seen[-1][:, 0], rng.permutation(seen[-1][:, 1])])] for seen in exposures]
