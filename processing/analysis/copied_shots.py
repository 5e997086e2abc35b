"""Shots that have the very droplets of another one: noise never repeats, so one of the two is a copy."""

import hashlib
from collections.abc import Iterable, Sequence

import numpy as np

from processing.analysis.droplets.droplet_file import PLACES, StoredDroplets

FEWEST_PLACES = 5
"""Of fewer different places nothing is said."""


def copies(shots: Sequence[StoredDroplets]) -> list[tuple[StoredDroplets, StoredDroplets]]:
    """Shots with those before them that have the same droplets, whatever they are called."""
    first: dict[bytes, StoredDroplets] = {}
    those_before = [(shot, first.setdefault(one, shot)) for shot in shots if (one := _print_of(shot))]
    return [(shot, other) for shot, other in those_before if other is not shot]


def copies_told(shots: Sequence[StoredDroplets]) -> tuple[str, ...]:
    """The same, for people."""
    return tuple(
        f"{named(shot)} has the very droplets of {named(other)}: one is a copy" for shot, other in copies(shots)
    )


def in_common(first: Iterable[StoredDroplets], second: Iterable[StoredDroplets]) -> int:
    """How many shots are in both: by their droplets, or, measured in another way, by their names."""
    known = {one for shot in second for one in (named(shot), _print_of(shot)) if one}
    return sum(named(shot) in known or _print_of(shot) in known for shot in first)


def named(shot: StoredDroplets) -> str:
    """Run and shot."""
    return f"{shot.provenance.get('run', 'a run')}, shot {shot.provenance.get('shot', '?')}"


def _print_of(shot: StoredDroplets) -> bytes:
    """A hash of all places; empty where they are too few."""
    places = [shot.columns[name] for name in sorted(shot.columns) if name.startswith(PLACES)]
    if not places or len(np.unique(places[0])) < FEWEST_PLACES:
        return b""
    return hashlib.sha256(b"".join(np.ascontiguousarray(one).tobytes() for one in places)).digest()
