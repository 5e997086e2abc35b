"""Shots that have the very droplets or images of another one: noise never repeats, so one of the two is a copy.

Of one shot that was imported twice and measured in two ways, droplets differ, and images do not.
"""

import hashlib
from collections.abc import Iterable, Sequence

import numpy as np

from processing.analysis.droplets.droplet_file import PLACES, StoredDroplets

IMAGES = "images"
"""Of a shot: a hash of its images; empty where these are of one grey value."""
FEWEST_PLACES = 5
"""Of fewer different places nothing is said."""


def copies(shots: Sequence[StoredDroplets]) -> list[tuple[StoredDroplets, StoredDroplets]]:
    """Shots with those before them that have the same droplets or images, whatever they are called."""
    first: dict[str, StoredDroplets] = {}
    found = []
    for shot in shots:
        if before := [first[one] for one in _prints_of(shot) if one in first]:
            found.append((shot, before[0]))
        first |= {one: first.get(one, shot) for one in _prints_of(shot)}
    return found


def copies_told(shots: Sequence[StoredDroplets]) -> tuple[str, ...]:
    """The same, for people."""
    return tuple(
        f"{shot.name} has the very {_shared(shot, other)} of {other.name}: one is a copy"
        for shot, other in copies(shots)
    )


def in_common(first: Iterable[StoredDroplets], second: Iterable[StoredDroplets]) -> int:
    """How many shots are in both: by their droplets, or, measured in another way, by their images or names."""
    known = {one for shot in second for one in (shot.name, *_prints_of(shot))}
    return sum(not known.isdisjoint((shot.name, *_prints_of(shot))) for shot in first)


def _prints_of(shot: StoredDroplets) -> list[str]:
    """A hash of all places, unless they are too few, and that of its images, where it has them."""
    prints = [_places_of(shot), str(shot.provenance.get(IMAGES, ""))]
    return [one for one in prints if one]


def _shared(shot: StoredDroplets, other: StoredDroplets) -> str:
    places = _places_of(shot)
    return "droplets" if places and places == _places_of(other) else "images"


def _places_of(shot: StoredDroplets) -> str:
    places = [shot.columns[name] for name in sorted(shot.columns) if name.startswith(PLACES)]
    if not places or len(np.unique(places[0])) < FEWEST_PLACES:
        return ""
    return hashlib.sha256(b"".join(np.ascontiguousarray(one).tobytes() for one in places)).hexdigest()
