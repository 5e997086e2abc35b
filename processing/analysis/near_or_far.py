"""Is near taken for far? Told by how many lines of sight meet closely, as images are and if all of them were turned.

Shots of few droplets tell it together.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.stored_json import stored_json

CLOSE_PX = 0.25
"""Root mean square, over views, of how far lines of sight may pass a droplet that they are said to meet at."""
SURE = 5.0
"""Standard deviations of the difference of two counts."""
ENOUGH = 600
"""Droplets of several shots at which lines of sight meet."""
AS_SEEN = "as images are"
SIGHTS = "sights"
"""Of a shot: at how many droplets lines of sight meet, by what is assumed; a JSON table."""


def depth_reversed(counts: Mapping[str, int]) -> str:
    """What was mistaken for all views at once, so that near looks far; empty where counts do not say so for sure."""
    met = counts.get(AS_SEEN, 0)
    sure = {what: count for what, count in counts.items() if _surely_more(count, met)}
    if not sure:
        return ""
    return (
        f"all views agree on {met} droplets within {CLOSE_PX:g} px, and on {max(sure.values())} if "
        f"{', or '.join(sure)}: depth is reversed"
    )


def depth_known(counts: Mapping[str, int]) -> bool:
    """Whether lines of sight meet at surely more droplets as images are than if these were turned in any way."""
    turned = [count for what, count in counts.items() if what != AS_SEEN]
    return bool(turned) and all(_surely_more(counts.get(AS_SEEN, 0), count) for count in turned)


def sights_of(shots: Sequence[StoredDroplets]) -> dict[str, int]:
    """Counts of all shots together; of those from before, none."""
    return added(stored_json(shot.provenance, SIGHTS) for shot in shots)


def added(several: Iterable[Mapping[str, int]]) -> dict[str, int]:
    """Counts of several shots together, of the first ones that are enough: of many more, chance is sure of anything."""
    together: Counter[str] = Counter()
    for one in several:
        if max(together.values(), default=0) >= ENOUGH:
            break
        together.update(one)
    return dict(together)


def depth_doubts(shots: Sequence[StoredDroplets]) -> tuple[str, ...]:
    """What all shots together say."""
    return doubts_of(sights_of(shots))


def doubts_of(together: Mapping[str, int]) -> tuple[str, ...]:
    """What counts of all shots together say."""
    told = depth_reversed(together)
    return (f"all shots together: {told}",) if told else ()


def _surely_more(count: int, other: int) -> bool:
    return bool(count - other > SURE * np.sqrt(count + other))
