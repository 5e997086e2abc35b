"""Droplets of a series in time, linked to tracks over all frames.

Two frames give the first motion, as two exposures do (``pairing``). From then on every track says where its droplet
should be next, and a new one moves like the tracks around it. Candidates are weighed as partners are, and all tracks
and droplets of a frame are assigned together; a track whose droplet is not there waits, and is linked again beyond the
gap. How much droplets accelerate, how alike they look from frame to frame, and how many are seen again is estimated on
the way.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from processing.analysis.velocity.common_motion import Indices
from processing.analysis.velocity.local_motion import KnownMotion, predicted
from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.analysis.velocity.pairing import LEAST_SCATTER_VOXEL, SHARES, pair
from processing.analysis.velocity.partners import (
    LEAST_UNLIKENESS,
    Spread,
    assigned,
    candidates_near,
    likely_of,
    odds_of,
)
from processing.analysis.velocity.track_states import TrackStates
from processing.geometry import FloatArray

MOST_MISSED = 3
"""Frames without its droplet after which a track has ended."""
LEAST_LENGTH = 3
"""Droplets of a track that is told: two may be a chance."""
KNOWN_LENGTH = 2
"""Droplets of a track that knows its velocity."""
FEWEST_KNOWN = 3
FIRST_ACCELERATION, ACCELERATIONS = 0.5, (0.01, 4.0)
"""Voxels per frame squared: at first, and as little and as much as is believed."""
STEP = (0.5, 2.0)
"""By so much at most the acceleration is corrected from frame to frame."""
NO_TRACK = -1


@dataclass(frozen=True, eq=False)
class Tracks:
    """Tracks of a series.

    Parameters
    ----------
    ids : tuple of (N,) int arrays
        For every frame the track of each droplet; -1 where it has none.
    p_link : tuple of (N,) arrays
        Probability of the link to the droplet before; not a number where a track begins, or there is none.
    count : int
        Number of tracks.
    """

    ids: tuple[Indices, ...]
    p_link: tuple[FloatArray, ...]
    count: int


def link(frames: Sequence[MovingDroplets]) -> Tracks:
    """Link the droplets of frames at even times.

    Parameters
    ----------
    frames : sequence of MovingDroplets
        In their order; a frame may be empty.
    """
    ids = [np.full(len(seen), NO_TRACK, np.intp) for seen in frames]
    p_link = [np.full(len(seen), np.nan) for seen in frames]
    linker: _Linker | None = None
    for number, seen in enumerate(frames):
        if linker is None:
            if number + 1 < len(frames):
                linker = _Linker.begun(seen, frames[number + 1])
            if linker is not None:
                ids[number] = linker.tracks.ids
            continue
        linker, ids[number], p_link[number] = linker.followed(seen)
    return _told(ids, p_link)


@dataclass(frozen=True, eq=False)
class _Linker:
    """Tracks so far, and how they behave."""

    tracks: TrackStates
    scatter: float
    acceleration: float
    spread: Spread
    next_id: int

    @classmethod
    def begun(cls, first: MovingDroplets, second: MovingDroplets) -> "_Linker | None":
        """With all droplets of a frame; None where those of the next have no motion in common with them."""
        pairing = pair(first, second)
        if pairing.shifts is None:
            return None
        tracks = TrackStates.begun(np.arange(len(first)), first, pairing.shifts, pairing.spread.scatter)
        return cls(tracks, pairing.spread.scatter, FIRST_ACCELERATION, pairing.spread, len(first))

    def followed(self, seen: MovingDroplets) -> "tuple[_Linker, Indices, FloatArray]":
        """After another frame; the tracks of its droplets, and the probabilities of their links."""
        onward = self.tracks.onward(self.acceleration)
        spread = Spread(0.0, self.spread.unlikeness, self.spread.share)
        candidates = candidates_near(onward.droplets, seen, np.zeros((1, 3)))
        odds = odds_of(candidates, onward.droplets, seen, spread)
        chosen = assigned(candidates, odds, len(onward), len(seen))
        rows, linked = candidates.own[chosen], candidates.other[chosen]
        ids, p_link = np.full(len(seen), NO_TRACK, np.intp), np.full(len(seen), np.nan)
        ids[linked], p_link[linked] = onward.ids[rows], likely_of(candidates, odds)[chosen]
        new = np.flatnonzero(ids == NO_TRACK)
        ids[new] = self.next_id + np.arange(len(new))
        tracks = onward.seen(rows, seen.where(linked))
        scatter, velocities = _around(tracks, seen.places[new], self.scatter)
        begun = TrackStates.begun(ids[new], seen.where(new), velocities, scatter)
        going = tracks.where(np.flatnonzero(tracks.missed < MOST_MISSED))
        after = _Linker(
            going.joined(begun),
            scatter,
            self._acceleration(onward, rows, seen.where(linked)),
            self._spread(onward, rows, seen.where(linked)),
            self.next_id + len(new),
        )
        return after, ids, p_link

    def _acceleration(self, onward: TrackStates, rows: Indices, seen: MovingDroplets) -> float:
        """As large as the misses of tracks that know their velocity say."""
        known = onward.lengths[rows] >= KNOWN_LENGTH
        if np.count_nonzero(known) < FEWEST_KNOWN:
            return self.acceleration
        misses = (seen.places - onward.places[rows])[known]
        variances = np.einsum("nii->ni", (onward.covariance[rows][:, :3, :3] + seen.covariance)[known])
        excess = float(np.sqrt(np.median(misses**2 / variances) / 0.455))  # the median of chi squared is 0.455
        return float(np.clip(self.acceleration * np.clip(excess, *STEP), *ACCELERATIONS))

    def _spread(self, onward: TrackStates, rows: Indices, seen: MovingDroplets) -> Spread:
        if not len(rows):
            return self.spread
        unlike = float(np.sqrt(np.mean((seen.log_sizes - onward.log_sizes[rows]) ** 2)))
        share = len(rows) / max(len(onward), 1)
        return Spread(self.spread.scatter, max(unlike, LEAST_UNLIKENESS), float(np.clip(share, *SHARES)))


def _around(tracks: TrackStates, places: FloatArray, scatter: float) -> tuple[float, FloatArray]:
    """How much velocities of neighbours differ, and the velocity around places."""
    known = tracks.where(np.flatnonzero((tracks.lengths >= KNOWN_LENGTH) & (tracks.missed == 0)))
    if len(known) < FEWEST_KNOWN:
        mean = tracks.velocities.mean(axis=0) if len(tracks) else np.zeros(3)
        return scatter, np.tile(mean, (len(places), 1))
    own = KnownMotion(known.places, known.velocities, np.ones(len(known)), np.arange(len(known)))
    apart = known.velocities - predicted(own, known.places)
    renewed = 1.4826 * float(np.median(np.abs(apart)))
    nobodys = KnownMotion(own.places, own.shifts, own.weights, np.full(len(known), NO_TRACK))
    velocities = predicted(nobodys, places) if len(places) else np.empty((0, 3))
    return max(renewed, LEAST_SCATTER_VOXEL), velocities


def _told(ids: list[Indices], p_link: list[FloatArray]) -> Tracks:
    """Without tracks that are too short, numbered from 0 in the order of their first droplets."""
    every = np.concatenate([np.empty(0, np.intp), *ids])
    numbers, first, lengths = np.unique(every[every != NO_TRACK], return_index=True, return_counts=True)
    long = lengths >= LEAST_LENGTH
    chosen = numbers[long][np.argsort(first[long], kind="stable")]
    renumbered = np.full(int(every.max(initial=0)) + 2, NO_TRACK, np.intp)
    renumbered[chosen] = np.arange(len(chosen))
    told = [renumbered[one] for one in ids]
    p_told = [np.where(one != NO_TRACK, p, np.nan) for one, p in zip(told, p_link, strict=True)]
    return Tracks(tuple(told), tuple(p_told), len(chosen))
