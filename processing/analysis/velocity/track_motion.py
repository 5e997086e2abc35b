"""Velocity and acceleration along tracks: a parabola through a droplet and those before and after it on its track."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from processing.analysis.velocity.common_motion import Indices
from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.analysis.velocity.tracks import Tracks
from processing.geometry import FloatArray

HALF_WINDOW = 2
"""Frames before and after a droplet that have a say: five points smooth noise to a third and blur little."""
PARABOLA = 3
"""Points without which there is no motion."""
UNKNOWN = 1e4
"""Standard deviation of what nothing is known of, in voxels and frames."""
LEAST_VARIANCE = 1e-6
"""Of a place, in square voxels: droplets without noise have some."""


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
    """

    track: Indices
    frame: Indices
    row: Indices
    places: FloatArray
    velocities: FloatArray
    accelerations: FloatArray
    velocity_covariance: FloatArray
    acceleration_sd: FloatArray


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
    track, frame, row = _by_track(tracks)
    seen = [frames[k].where(row[frame == k]) for k in range(len(frames))]
    order = np.argsort(np.argsort(frame, kind="stable"), kind="stable")
    places = np.concatenate([np.empty((0, 3)), *(one.places for one in seen)])[order]
    covariance = np.concatenate([np.empty((0, 3, 3)), *(one.covariance for one in seen)])[order]
    motion, uncertainty = _parabolas(track, frame, places, covariance, half_window)
    return TrackPoints(
        track,
        frame,
        row,
        motion[:, 0],
        motion[:, 1],
        motion[:, 2],
        uncertainty[:, 3:6, 3:6],
        np.sqrt(np.einsum("nii->ni", uncertainty[:, 6:, 6:])),
    )


def _by_track(tracks: Tracks) -> tuple[Indices, Indices, Indices]:
    """Track, frame and row of all droplets that have a track, in this order."""
    track = np.concatenate([np.empty(0, np.intp), *tracks.ids])
    frame = np.repeat(np.arange(len(tracks.ids)), [len(ids) for ids in tracks.ids])
    row = np.concatenate([np.empty(0, np.intp), *(np.arange(len(ids)) for ids in tracks.ids)])
    chosen = np.flatnonzero(track >= 0)
    chosen = chosen[np.lexsort((frame[chosen], track[chosen]))]
    return track[chosen], frame[chosen], row[chosen]


def _parabolas(
    track: Indices, frame: Indices, places: FloatArray, covariance: FloatArray, half_window: int
) -> tuple[FloatArray, FloatArray]:
    """Place, velocity and acceleration (N, 3, 3) at every point, and the covariance (N, 9, 9) of the nine."""
    normal = np.zeros((len(track), 9, 9))
    right = np.zeros((len(track), 9))
    votes = np.zeros(len(track), np.intp)
    weights = np.linalg.inv(covariance + LEAST_VARIANCE * np.eye(3))
    for step in range(-half_window, half_window + 1):
        own, other = _neighbours(track, frame, step, half_window)
        after = (frame[other] - frame[own]).astype(np.float64)
        basis = np.stack([np.ones_like(after), after, after**2 / 2], axis=1)
        block = np.einsum("na,nb,nij->naibj", basis, basis, weights[other]).reshape(-1, 9, 9)
        pull = np.einsum("nij,nj->ni", weights[other], places[other] - places[own])
        np.add.at(normal, own, block)
        np.add.at(right, own, np.einsum("na,ni->nai", basis, pull).reshape(-1, 9))
        np.add.at(votes, own, 1)
    free = normal + np.eye(9) / UNKNOWN**2
    uncertainty = np.asarray(np.linalg.inv(free), np.float64)
    motion = np.einsum("nij,nj->ni", uncertainty, right).reshape(-1, 3, 3)
    motion[:, 0] += places
    motion[votes < PARABOLA, 1:] = np.nan
    uncertainty[votes < PARABOLA] = np.nan
    return motion, uncertainty


def _neighbours(track: Indices, frame: Indices, step: int, half_window: int) -> tuple[Indices, Indices]:
    """Points, and those that come so many points later on the same track, within the window."""
    own = np.arange(max(0, -step), len(track) - max(0, step))
    other = own + step
    near = (track[own] == track[other]) & (np.abs(frame[other] - frame[own]) <= half_window)
    return own[near], other[near]
