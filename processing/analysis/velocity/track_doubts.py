"""Whether tracks contradict the rate and the order of their shots: nothing else says that these are stated wrongly."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.droplets.droplet_statistics import P_REAL, measured_grid
from processing.analysis.droplets.droplet_table import Columns
from processing.analysis.shot_doubts import COMPONENTS
from processing.analysis.stored_json import stored_json
from processing.analysis.two_exposures.alone_droplets import Alone, alone_among
from processing.analysis.velocity.common_motion import Indices
from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.analysis.velocity.pairing import pair
from processing.analysis.velocity.velocity_verdict import FASTEST_M_S, MOST_STILL, STILL
from processing.geometry import FloatArray
from processing.volume import VoxelGrid

MOST_APART = 1.5
"""Ratio of the median speeds of the same droplets, by tracks and by both exposures of a shot, in any direction."""
MOST_OFF_RATE = 0.05
"""The same along the direction in which they fly, over the speed: what is surely more is no noise."""
LEAST_LINKED, FEWEST = 0.1, 10
"""Share of the droplets of a shot that are on tracks, and of those that are on tracks from a shot to the next one; of
fewer droplets than so many nothing is said."""
MOST_LISTED = 5
VARIANCES = ("cov_uu_m2_s2", "cov_vv_m2_s2", "cov_ww_m2_s2")
TOGETHER = 0.5
"""Amount of the mean velocity over the mean speed, from which on droplets have a direction."""
LEAST_JUMP, LEAST_JUMP_VOXEL, SURE = 0.15, 0.2, 5.0
"""Share of its way by which a median droplet is farther at once, the least of it, as rigs shake by some hundredths of a
voxel, and standard deviations by which it is known."""
MOST_DIRT, SLOW = 0.03, 0.25
"""Share of the droplets on tracks that may stand still; below that share of their median speed others are slow."""
THIN = 0.5
"""Share of the droplets of a shot that tracks link to the next one, below which they are paired anew."""
MOST_OFF = 0.02
"""Share of the surely real droplets that may be on no track: of one that stays in the grid tracks see five shots."""
WATCHED, COMMON_WAYS = 2, (0.01, 0.99)
"""Shots before and after a droplet that should be on a track, and quantiles of the velocities that it may have."""
MM_PER_M = 1000.0
TINY = 1e-12


def rate_doubts(tracks: Columns, shots: Sequence[StoredDroplets], rate_hz: float) -> Iterator[str]:
    """Speeds that no spray has, or that are others than those between exposures A and B.

    Parameters
    ----------
    tracks : dict of name to (N,) array
        A row per droplet on a track.
    shots : sequence of StoredDroplets
        Those of the tracks.
    rate_hz : float
        Of the shots.
    """
    velocities_m_s, paired_m_s = _velocities(tracks), _paired(tracks, shots)
    known = np.isfinite(velocities_m_s).all(axis=1)
    if not known.any():
        return
    if (median_m_s := np.median(_amounts(velocities_m_s[known]))) > FASTEST_M_S:
        yield f"droplets fly at {median_m_s:.3g} m/s, faster than any spray: is the rate of {rate_hz:g} Hz right?"
    both = known & np.isfinite(paired_m_s).all(axis=1)
    shot = tracks["shot"].astype(np.intp)
    early = shot <= np.median(shot)
    unsure_m_s = _unsure_m_s(shots[0])
    parts = (both, both & early, both & ~early)
    if told := [one for part in parts if (one := _apart(velocities_m_s[part], paired_m_s[part], unsure_m_s))]:
        by_tracks, by_pairs = told[0]
        yield (
            f"droplets fly at {by_tracks:.3g} m/s from shot to shot, but at {by_pairs:.3g} m/s from A to B: is the "
            f"rate of {rate_hz:g} Hz right, are shots at even times, and is the separation right?"
        )


def _apart(by_tracks: FloatArray, by_pairs: FloatArray, unsure_m_s: float) -> tuple[float, float] | None:
    """Median speeds of the same droplets by two ways, (N, 3) each, where they differ; along their direction, if any."""
    if len(by_pairs) < FEWEST:
        return None
    mean_m_s = by_pairs.mean(axis=0)
    amount_m_s = float(np.linalg.norm(mean_m_s))
    if amount_m_s <= TOGETHER * _amounts(by_pairs).mean():
        first, second = (float(np.median(_amounts(one))) for one in (by_tracks, by_pairs))
        return (first, second) if max(first, second) > MOST_APART * min(first, second) else None
    along, also = (one @ mean_m_s / amount_m_s for one in (by_tracks, by_pairs))
    apart, second = along - also, float(np.median(also))
    off = float(np.median(apart))
    sd = 1.4826 * float(np.median(np.abs(apart - off))) * np.sqrt(np.pi / 2 / len(apart))
    return (second + off, second) if abs(off) > max(MOST_OFF_RATE * second, SURE * sd, unsure_m_s) else None


def _unsure_m_s(shot: StoredDroplets) -> float:
    """Of a velocity from A to B, if a rig shakes; 0 where the file does not tell their separation."""
    separation_ns, grid = stored_json(shot.provenance, "velocity").get("separation_ns"), measured_grid(shot)
    return LEAST_JUMP_VOXEL * grid.pitch_mm * 1e6 / separation_ns if separation_ns and grid else 0.0


def order_doubts(tracks: Columns, shots: Sequence[StoredDroplets]) -> Iterator[str]:
    """Shots out of order: on no track, followed by none, or all of them backwards, against the axis of the spray.

    Parameters
    ----------
    tracks, shots
        As of ``rate_doubts``; shots in their order.
    """
    if not len(tracks["track"]):
        return
    asked = "are shots in the order in which they were taken, at even times, and none missing?"
    numbers = np.array([shot.provenance["shot"] for shot in shots], np.intp)
    seen = np.array([np.count_nonzero(shot.columns["frame"] == "a") for shot in shots])
    linked, going_on = _linked(tracks, numbers)
    if len(off := numbers[(seen >= FEWEST) & (linked < LEAST_LINKED * seen)]):
        yield f"hardly a droplet of {len(off)} of {len(shots)} shots is on a track (shot {_listed(off)}): {asked}"
    fewer = np.minimum(linked[:-1], linked[1:])
    if len(cuts := numbers[:-1][(fewer >= FEWEST) & (going_on < LEAST_LINKED * fewer)]):
        yield f"hardly a track goes on after {len(cuts)} of {len(shots)} shots (shot {_listed(cuts)}): {asked}"
    yield from _backwards(tracks, stored_json(shots[0].provenance, "spray"))


def still_doubts(tracks: Columns) -> Iterator[str]:
    """Droplets that do not move: dirt does not.

    Parameters
    ----------
    tracks
        As of ``rate_doubts``.
    """
    speeds_m_s = _amounts(_velocities(tracks))
    sd_m_s = np.sqrt(np.sum([np.asarray(tracks[name], np.float64) for name in VARIANCES], axis=0))
    known = np.isfinite(speeds_m_s) & np.isfinite(sd_m_s)
    if known.sum() < FEWEST:
        return
    still, speeds_m_s = speeds_m_s[known] < STILL * sd_m_s[known], speeds_m_s[known]
    if _lies_still(still, speeds_m_s):
        share = f"{100 * np.mean(still):.0f} % of the droplets on tracks stand still"
        yield f"{share}, as sure as that is known: is it dirt? Means of velocities hold it"


def _lies_still(still: NDArray[np.bool_], speeds_m_s: FloatArray) -> bool:
    """Whether most stand still, or a part of them while hardly any of the others is slow."""
    if np.mean(still) > MOST_STILL:
        return True
    slow = ~still & (speeds_m_s < SLOW * np.median(speeds_m_s[~still]))
    few = max(MOST_DIRT * len(still), FEWEST)
    return bool(np.count_nonzero(still) > few and np.count_nonzero(slow) < np.count_nonzero(still) / 2)


def alone_on_no_track(tracks: Columns, shots: Sequence[StoredDroplets], rate_hz: float) -> Alone:
    """Droplets on no track that would stay in the grid for two shots before and after, were they like those on tracks.

    Parameters
    ----------
    tracks, shots, rate_hz
        As of ``rate_doubts``.
    """
    if not len(ways_mm := _common_ways_mm(tracks, rate_hz)) or not (grid := measured_grid(shots[0])):
        return Alone(0, 0, sure=False)
    numbers = {_number(shot) for shot in shots}
    asked = [shot for shot in shots if P_REAL in shot.columns and numbers >= _around(_number(shot))]
    staying = [(shot, _staying(shot, grid, ways_mm)) for shot in asked]
    p_real = [np.asarray(shot.columns[P_REAL], np.float64)[rows] for shot, rows in staying]
    linked = [np.isin(rows, tracks["droplet"][tracks["shot"] == _number(shot)]) for shot, rows in staying]
    return alone_among(np.concatenate([np.empty(0), *p_real]), np.concatenate([np.empty(0, np.bool_), *linked]))


def _common_ways_mm(tracks: Columns, rate_hz: float) -> FloatArray:
    """The shortest and longest common way (2, 3) from one shot to the next; (0, 3) where nothing moves."""
    velocities_m_s = _velocities(tracks)
    flying = velocities_m_s[np.isfinite(velocities_m_s).all(axis=1)]
    return np.quantile(flying, COMMON_WAYS, axis=0) * MM_PER_M / rate_hz if len(flying) else flying


def _staying(shot: StoredDroplets, grid: VoxelGrid, ways_mm: FloatArray) -> Indices:
    """Rows of exposure A that stay in the grid for two shots before and after, by all common ways."""
    points_mm = np.column_stack([np.asarray(shot.columns[f"{axis}_mm"], np.float64) for axis in "xyz"])
    stays = np.all([grid.holds(points_mm + one * way) for one in (-WATCHED, WATCHED) for way in ways_mm], axis=0)
    return np.flatnonzero(stays & (shot.columns["frame"] == "a"))


def _around(number: int) -> set[int]:
    return {number + one for one in range(-WATCHED, WATCHED + 1)}


def _number(shot: StoredDroplets) -> int:
    return int(shot.provenance["shot"])


def uneven_doubts(frames: Sequence[MovingDroplets], ids: Sequence[Indices], first: int) -> Iterator[str]:
    """All droplets faster or slower at once, as they look where a shot is missing, or times are uneven.

    Accelerations that last, as by gravity or drag, are no doubt: what is told differs from those of the other shots.

    Parameters
    ----------
    frames : sequence of MovingDroplets
        Of all shots, in their order.
    ids : sequence of (N,) int arrays
        Track of each droplet; -1 where it has none.
    first : int
        Number of the first shot.
    """
    pairs = [_same_droplets(frames[one : one + 2], ids[one : one + 2]) for one in range(len(frames) - 1)]
    known = [
        (first + middle, *change)
        for middle in range(1, len(frames) - 1)
        if (change := _change(frames[middle - 1 : middle + 2], pairs[middle - 1 : middle + 1]))
    ]
    if not known:
        return
    numbers, changes, sds, ways = (np.array(column) for column in zip(*known, strict=True))
    jumps, way = np.abs(changes - np.median(changes)), float(np.median(ways))
    odd = (jumps > SURE * sds) & (jumps > max(LEAST_JUMP * way, LEAST_JUMP_VOXEL))
    if odd.any():
        where = f"{np.count_nonzero(odd)} of {len(frames)} shots (shot {_listed(numbers[odd])})"
        yield (
            f"all droplets together are suddenly faster or slower, by up to {100 * jumps.max() / way:.0f} % of their "
            f"way, at {where}: are shots at even times, and none missing? Velocities and accelerations are wrong there"
        )


def _same_droplets(frames: Sequence[MovingDroplets], ids: Sequence[Indices]) -> tuple[Indices, Indices]:
    """Indices of the same droplets in two frames: by their tracks, or, where hardly one goes on, by pairing."""
    _, own, other = np.intersect1d(ids[0], ids[1], return_indices=True)
    on_tracks = ids[0][own] >= 0
    if np.count_nonzero(on_tracks) < THIN * min(map(len, frames)):
        return pair(*frames).pairs
    return own[on_tracks], other[on_tracks]


def _change(
    frames: Sequence[MovingDroplets], pairs: Sequence[tuple[Indices, Indices]]
) -> tuple[float, float, float] | None:
    """By how much a median droplet flies farther after the middle one of three frames than before it.

    Returns
    -------
    tuple of three floats, or None
        Change, its standard deviation, and the way, in voxels; None of too few droplets.
    """
    (before, own), (again, after) = pairs
    _, early, late = np.intersect1d(own, again, return_indices=True)
    if len(early) < FEWEST:
        return None
    came = frames[1].places[own[early]] - frames[0].places[before[early]]
    went = frames[2].places[after[late]] - frames[1].places[again[late]]
    ways = np.linalg.norm(came + went, axis=1) / 2
    changes = np.einsum("ni,ni->n", went - came, came + went) / np.maximum(2 * ways, TINY)
    middle = float(np.median(changes))
    sd = 1.4826 * float(np.median(np.abs(changes - middle))) * np.sqrt(np.pi / 2 / len(changes))
    return middle, float(sd), float(np.median(ways))


def _linked(tracks: Columns, numbers: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Droplets on tracks in each shot, and tracks that go on from each to the next one."""
    shot, track = tracks["shot"].astype(np.intp), tracks["track"].astype(np.intp)
    order = np.lexsort((shot, track))
    ends = np.flatnonzero(np.diff(track[order])) + 1
    first, last = shot[order][np.append(0, ends)], shot[order][np.append(ends - 1, len(order) - 1)]
    own = np.sort(shot)
    linked = np.searchsorted(own, numbers, "right") - np.searchsorted(own, numbers, "left")
    begun = np.searchsorted(np.sort(first), numbers[:-1], "right")
    return linked, begun - np.searchsorted(np.sort(last), numbers[:-1], "right")


def _listed(numbers: NDArray[np.intp]) -> str:
    return ", ".join(map(str, numbers[:MOST_LISTED])) + (" ..." if len(numbers) > MOST_LISTED else "")


def _backwards(tracks: Columns, stated: Mapping[str, Any]) -> Iterator[str]:
    velocities_m_s = _velocities(tracks)
    flying = velocities_m_s[np.isfinite(velocities_m_s).all(axis=1)]
    if not stated or not len(flying):
        return
    mean_m_s, speed_m_s = flying.mean(axis=0), float(np.linalg.norm(flying, axis=1).mean())
    if mean_m_s @ np.array(stated["axis"]) < 0 and np.linalg.norm(mean_m_s) > TOGETHER * speed_m_s:
        yield "droplets fly against the axis of the spray: are shots in the order in which they were taken?"


def _velocities(columns: Columns) -> FloatArray:
    return np.column_stack([np.asarray(columns[name], np.float64) for name in COMPONENTS])


def _amounts(velocities_m_s: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(velocities_m_s, axis=1))


def _paired(tracks: Columns, shots: Sequence[StoredDroplets]) -> FloatArray:
    """Velocities from A to B of the droplets on tracks, (N, 3); not a number where a droplet has none."""
    velocities_m_s = np.full((len(tracks["track"]), 3), np.nan)
    for shot in shots:
        if COMPONENTS[0] in shot.columns:
            own: NDArray[np.bool_] = tracks["shot"] == shot.provenance["shot"]
            rows = tracks["droplet"][own].astype(np.intp)
            velocities_m_s[own] = _velocities(shot.columns)[shot.columns["frame"] == "a"][rows]
    return velocities_m_s
