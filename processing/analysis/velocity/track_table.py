"""Tracks of the droplets of a series of shots, as files have them: a row per droplet on a track."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from processing.analysis.copied_shots import copies
from processing.analysis.droplets.droplet_file import DropletFileError, StoredDroplets
from processing.analysis.droplets.droplet_table import COVARIANCES as PLACES
from processing.analysis.droplets.droplet_table import Columns
from processing.analysis.shot_doubts import exposure_doubts
from processing.analysis.velocity import HALF_WINDOW
from processing.analysis.velocity.common_motion import FEWEST
from processing.analysis.velocity.moving_droplets import LEAST_SIZE, MovingDroplets
from processing.analysis.velocity.noise_curve import M_PER_MM, NoiseCurve, noise_curve
from processing.analysis.velocity.track_doubts import (
    MOST_OFF,
    alone_on_no_track,
    order_doubts,
    rate_doubts,
    still_doubts,
    uneven_doubts,
)
from processing.analysis.velocity.track_motion import TrackPoints, track_points
from processing.analysis.velocity.tracks import LEAST_LENGTH, Tracks, link
from processing.analysis.velocity.velocity_table import COVARIANCES
from processing.count import require_count
from processing.geometry import FloatArray
from processing.reconstruction.settings import GridSettings
from processing.volume import VoxelGrid

MOST_FRAMES = 100_000
"""From the first shot to the last one, with those that are not there."""
SIZES = ("diameter_um", "amplitude")
NO_RATE = "nobody stated at which rate its shots were taken: give rate_hz (--rate-hz), or state it in the manifest"
NO_TRACK = (
    "no droplet is on a track: do droplets move by more than 25 voxels from shot to shot, are shots at even times, and "
    "are they of one series?"
)


ON_NO_TRACK = ("stay in the grid are on no track", "are not seen again")
"""What is said of droplets that do so, and what else they may do than fly in another motion."""


@dataclass(frozen=True, eq=False)
class DropletTracks:
    """Tracks of a series.

    Parameters
    ----------
    columns : dict of name to (N,) array
        A row per droplet on a track, track by track and shot by shot.
    tracks : int
        Their number.
    droplets : int
        Of all shots, on a track or not.
    rate_hz : float
        Of the shots.
    reason : str | None
        Why there is no track.
    doubts : tuple of str
        Why not to trust them: verdicts on the shots, velocities that contradict the rate.
    half_window : int
        Shots before and after a droplet that have a say in its motion.
    noise_curve : NoiseCurve | None
        What other half windows would show; None with few droplets on tracks.
    share_alone : float | None
        Of the surely real droplets that would stay in the grid, those on no track; None where something else is
        doubted, or nothing tells which are real.
    """

    columns: Columns
    tracks: int
    droplets: int
    rate_hz: float
    reason: str | None
    doubts: tuple[str, ...] = ()
    half_window: int = HALF_WINDOW
    noise_curve: NoiseCurve | None = None
    share_alone: float | None = None

    @property
    def share_tracked(self) -> float:
        """Of the droplets, those on a track."""
        return len(self.columns["track"]) / self.droplets if self.droplets else 0.0

    @property
    def median_length(self) -> float | None:
        """Droplets of a median track; None without tracks."""
        return float(np.median(np.bincount(self.columns["track"].astype(np.intp)))) if self.tracks else None


def track_droplets(
    shots: Sequence[StoredDroplets], rate_hz: float | None = None, half_window: int = HALF_WINDOW
) -> DropletTracks:
    """Link the droplets of shots at even times to tracks.

    Parameters
    ----------
    shots : sequence of StoredDroplets
        Of one run, in any order, as ``read_droplets`` gives them; of two exposures A is taken. A shot that is not there
        is a frame without droplets.
    rate_hz : float, optional
        Shots per second; default: what their files say.
    half_window : int
        Velocity and acceleration are those of a parabola through so many frames before and after; ``noise_curve`` of
        the tracks says which are of least error.

    Raises
    ------
    DropletFileError
        They are of several runs, of one shot twice, or nobody knows their rate or their grid; or a shot is a copy of
        another one.
    """
    require_count("half_window", half_window, 1)
    ordered = sorted(shots, key=_shot)
    _require_one_series(ordered)
    rate_hz = _rate_hz(ordered[0]) if rate_hz is None else rate_hz
    if not 0 < rate_hz < np.inf:
        raise DropletFileError(f"rate_hz {rate_hz}: must be above 0, and finite")
    grid, first = _grid(ordered[0]), _shot(ordered[0])
    frames = [_NOBODY] * (_shot(ordered[-1]) - first + 1)
    for stored in ordered:
        frames[_shot(stored) - first] = _moving(stored, grid)
    linked = link(frames)
    points = track_points(frames, linked, half_window)
    columns = _columns(points, linked, first, grid, rate_hz) | _sizes(points, first, ordered)
    count = sum(map(len, frames))
    contradicted = (
        *rate_doubts(columns, ordered, rate_hz),
        *order_doubts(columns, ordered),
        *uneven_doubts(frames, linked.ids, first),
        *still_doubts(columns),
    )
    alone = None if contradicted else alone_on_no_track(columns, ordered, rate_hz)
    doubts = (*exposure_doubts(ordered, "a"), *contradicted, *(alone.said(*ON_NO_TRACK, MOST_OFF) if alone else ()))
    reason = None if linked.count else _why(frames)
    curve = noise_curve(frames, linked, grid.pitch_mm, rate_hz)
    share_alone = alone.share if alone and alone.sure else None
    return DropletTracks(columns, linked.count, count, rate_hz, reason, doubts, half_window, curve, share_alone)


def _why(frames: Sequence[MovingDroplets]) -> str:
    """Why there is no track."""
    seen = [len(frame) for frame in frames if len(frame)]
    if not seen:
        return "no droplet was measured in any shot"
    if len(seen) < LEAST_LENGTH:
        return f"a track takes {LEAST_LENGTH} shots with droplets, and there are {len(seen)}"
    if max(seen) < FEWEST:
        return f"shots have {max(seen)} droplets at most: {FEWEST} tell which way they fly, fewer may be anything"
    return NO_TRACK


_NOBODY = MovingDroplets(np.empty((0, 3)), np.empty((0, 3, 3)), np.empty(0))


def _shot(stored: StoredDroplets) -> int:
    if "shot" not in stored.provenance:
        raise DropletFileError("a file does not say which shot it is of: tracks need their order")
    return int(stored.provenance["shot"])


def _rate_hz(stored: StoredDroplets) -> float:
    if not (rate_hz := float(stored.provenance.get("rate_hz", 0))):
        raise DropletFileError(f"{stored.provenance.get('run', 'a run')}: {NO_RATE}")
    return rate_hz


def _grid(stored: StoredDroplets) -> VoxelGrid:
    if "grid" not in stored.provenance or "z_mm" not in stored.columns:
        raise DropletFileError("a file does not say in which grid its droplets were measured: tracks are in 3-D")
    return GridSettings.model_validate_json(str(stored.provenance["grid"])).to_grid()


def _require_one_series(ordered: Sequence[StoredDroplets]) -> None:
    if not ordered:
        raise DropletFileError("there are no shots to link")
    for name in ("run", "run_created_utc", "calibration_sha256", "recipe_sha256", "grid", "rate_hz"):
        if len(told := {str(stored.provenance.get(name)) for stored in ordered}) > 1:
            raise DropletFileError(f"shots of one series, please: their {name} is {' and '.join(sorted(told)[:2])}")
    numbers = [_shot(stored) for stored in ordered]
    for one, other in pairwise(numbers):
        if one == other:
            raise DropletFileError(f"shot {one} is there twice")
    for copied, original in copies(ordered):
        raise DropletFileError(f"{copied.name} has the very droplets of {original.name}: one is a copy; take it away")
    if numbers[-1] - numbers[0] >= MOST_FRAMES:
        raise DropletFileError(f"shots {numbers[0]} to {numbers[-1]}: a series has at most {MOST_FRAMES} frames")


def _of_a(stored: StoredDroplets, name: str) -> FloatArray:
    values: FloatArray = np.asarray(stored.columns[name], np.float64)[stored.columns["frame"] == "a"]
    return values


def _moving(stored: StoredDroplets, grid: VoxelGrid) -> MovingDroplets:
    points_mm = np.column_stack([_of_a(stored, f"{axis}_mm") for axis in "xyz"])
    covariance = np.empty((len(points_mm), 3, 3))
    for name in PLACES:
        row, column = ("xyz".index(axis) for axis in name)
        covariance[:, row, column] = covariance[:, column, row] = _of_a(stored, f"cov_{name}_mm2")
    sizes = _of_a(stored, next(name for name in SIZES if name in stored.columns))
    return MovingDroplets(
        grid.to_index(points_mm)[:, ::-1], covariance / grid.pitch_mm**2, np.log(np.maximum(sizes, LEAST_SIZE))
    )


def _columns(points: TrackPoints, linked: Tracks, first: int, grid: VoxelGrid, rate_hz: float) -> Columns:
    m_s, m_s2 = grid.pitch_mm * M_PER_MM * rate_hz, grid.pitch_mm * M_PER_MM * rate_hz**2
    places_mm = grid.to_mm(points.places[:, ::-1])
    covariance = points.velocity_covariance * m_s**2
    p_link = np.array([linked.p_link[frame][row] for frame, row in zip(points.frame, points.row, strict=True)])
    return {
        "track": points.track.astype(np.int64),
        "shot": (points.frame + first).astype(np.int64),
        "droplet": points.row.astype(np.int64),
        **{f"{axis}_mm": places_mm[:, number] for number, axis in enumerate("xyz")},
        **{f"{name}_m_s": points.velocities[:, number] * m_s for number, name in enumerate("uvw")},
        **{f"cov_{pair}_m2_s2": covariance[:, "uvw".index(pair[0]), "uvw".index(pair[1])] for pair in COVARIANCES},
        **{f"a{axis}_m_s2": points.accelerations[:, number] * m_s2 for number, axis in enumerate("xyz")},
        **{f"a{axis}_sd_m_s2": points.acceleration_sd[:, number] * m_s2 for number, axis in enumerate("xyz")},
        "p_link": p_link.astype(np.float64),
    }


def _sizes(points: TrackPoints, first: int, ordered: Sequence[StoredDroplets]) -> Columns:
    """Diameter or amplitude of every droplet, as its own shot has it."""
    name = next(name for name in SIZES if name in ordered[0].columns)
    sizes: NDArray[np.float64] = np.empty(len(points.track))
    for stored in ordered:
        chosen = points.frame == _shot(stored) - first
        sizes[chosen] = _of_a(stored, name)[points.row[chosen]]
    return {name: sizes}
