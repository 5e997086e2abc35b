"""Velocity and acceleration along tracks: a parabola through a droplet and those before and after it on its track."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.analysis.velocity import HALF_WINDOW
from processing.analysis.velocity.common_motion import Indices
from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.analysis.velocity.tracks import Tracks
from processing.geometry import FloatArray

PARABOLA = 3
"""Points without which there is no motion."""
UNKNOWN = 1e4
"""Standard deviation of what nothing is known of, in voxels and frames."""
LEAST_VARIANCE = 1e-6
"""Of a place, in square voxels: droplets without noise have some."""
TRACK_AFTER_TRACK = 1 << 32
"""Frames in which all tracks would follow one another without ever being near."""


@dataclass(frozen=True, eq=False)
class TrackPoints:
    """Droplets on tracks, track by track, frame by frame.

    Parameters
    ----------
    track, frame, row : (N,) int arrays
        Track, frame, and row of the droplet within its frame.
    places, velocities, accelerations : (N, 3) arrays
        In voxels, per frame, and per frame squared; smoothed. Motion is not a number where a track has fewer than
        three points within the window.
    velocity_covariance : (N, 3, 3) array
        By the covariances of the places.
    acceleration_sd : (N, 3) array
        Standard deviation, likewise.
    place_covariance : (N, 3, 3) array
        Likewise.
    """

    track: Indices
    frame: Indices
    row: Indices
    places: FloatArray
    velocities: FloatArray
    accelerations: FloatArray
    velocity_covariance: FloatArray
    acceleration_sd: FloatArray
    place_covariance: FloatArray


@dataclass(frozen=True, eq=False)
class SeenPoints:
    """Droplets on tracks as they were measured, track by track, frame by frame.

    Parameters
    ----------
    track, frame, row : (N,) int arrays
        As of ``TrackPoints``.
    places : (N, 3) array
        In voxels.
    covariance : (N, 3, 3) array
        Of the places.
    """

    track: Indices
    frame: Indices
    row: Indices
    places: FloatArray
    covariance: FloatArray

    @classmethod
    def of(cls, frames: Sequence[MovingDroplets], tracks: Tracks) -> "SeenPoints":
        """The droplets of all tracks."""
        track, frame, row = _by_track(tracks)
        seen = [frames[k].where(row[frame == k]) for k in range(len(frames))]
        order = np.argsort(np.argsort(frame, kind="stable"), kind="stable")
        places = np.concatenate([np.empty((0, 3)), *(one.places for one in seen)])[order]
        covariance = np.concatenate([np.empty((0, 3, 3)), *(one.covariance for one in seen)])[order]
        return cls(track, frame, row, places, covariance + LEAST_VARIANCE * np.eye(3))

    def where(self, chosen: NDArray[np.bool_]) -> "SeenPoints":
        """The chosen ones."""
        return SeenPoints(
            self.track[chosen], self.frame[chosen], self.row[chosen], self.places[chosen], self.covariance[chosen]
        )

    def apart(self, frames: int) -> tuple[Indices, Indices]:
        """Points, and those that come so many frames later on the same track."""
        when = self.track.astype(np.int64) * TRACK_AFTER_TRACK + self.frame
        other = np.searchsorted(when, when + frames).clip(max=len(when) - 1)
        own = np.flatnonzero(when[other] == when + frames)
        return own, other[own]


def track_points(frames: Sequence[MovingDroplets], tracks: Tracks, half_window: int = HALF_WINDOW) -> TrackPoints:
    """The droplets of all tracks, and their motion.

    Parameters
    ----------
    frames : sequence of MovingDroplets
        As linked.
    tracks : Tracks
        Theirs.
    half_window : int
        So many frames before and after a droplet have a say; at the ends of a track fewer.
    """
    parabolas = _Parabolas(SeenPoints.of(frames, tracks))
    for further in range(1, min(half_window, len(frames)) + 1):
        parabolas.widen(further)
    return parabolas.solved()


def smoothed(seen: SeenPoints, most: int) -> Iterator[TrackPoints]:
    """The points with half windows of 1, 2, 3 and so on, up to ``most`` frames."""
    parabolas = _Parabolas(seen)
    for further in range(1, most + 1):
        parabolas.widen(further)
        yield parabolas.solved()


def _by_track(tracks: Tracks) -> tuple[Indices, Indices, Indices]:
    """Track, frame and row of all droplets that have a track, in this order."""
    track = np.concatenate([np.empty(0, np.intp), *tracks.ids])
    frame = np.repeat(np.arange(len(tracks.ids)), [len(ids) for ids in tracks.ids])
    row = np.concatenate([np.empty(0, np.intp), *(np.arange(len(ids)) for ids in tracks.ids)])
    chosen = np.flatnonzero(track >= 0)
    chosen = chosen[np.lexsort((frame[chosen], track[chosen]))]
    return track[chosen], frame[chosen], row[chosen]


class _Parabolas:
    """Normal equations of the parabola at every point, for its place, velocity and acceleration: sums that grow.

    Parameters
    ----------
    seen : SeenPoints
        At first every parabola goes through its own point alone.
    """

    def __init__(self, seen: SeenPoints) -> None:
        count = len(seen.track)
        self._seen = seen
        self._weights = np.asarray(np.linalg.inv(seen.covariance), np.float64)
        self._normal, self._right = np.zeros((count, 9, 9)), np.zeros((count, 9))
        self._votes = np.zeros(count, np.intp)
        self._add(0)

    def widen(self, frames: int) -> None:
        """The points so many frames before and after have a say, too."""
        self._add(frames)
        self._add(-frames)

    def solved(self) -> TrackPoints:
        """By the points that had a say."""
        uncertainty = np.asarray(np.linalg.inv(self._normal + np.eye(9) / UNKNOWN**2), np.float64)
        motion = np.einsum("nij,nj->ni", uncertainty, self._right).reshape(-1, 3, 3)
        motion[:, 0] += self._seen.places
        motion[self._votes < PARABOLA, 1:] = np.nan
        uncertainty[self._votes < PARABOLA] = np.nan
        return TrackPoints(
            self._seen.track,
            self._seen.frame,
            self._seen.row,
            motion[:, 0],
            motion[:, 1],
            motion[:, 2],
            uncertainty[:, 3:6, 3:6],
            np.sqrt(np.einsum("nii->ni", uncertainty[:, 6:, 6:])),
            uncertainty[:, :3, :3],
        )

    def _add(self, frames: int) -> None:
        own, other = self._seen.apart(frames)
        basis = np.array([1.0, frames, frames**2 / 2])
        pull = np.einsum("nij,nj->ni", self._weights[other], self._seen.places[other] - self._seen.places[own])
        self._normal[own] += np.einsum("a,b,nij->naibj", basis, basis, self._weights[other]).reshape(-1, 9, 9)
        self._right[own] += np.einsum("a,ni->nai", basis, pull).reshape(-1, 9)
        self._votes[own] += 1
