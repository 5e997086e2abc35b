"""Whether the velocities of tracks contradict the rate of their shots: nothing else says that it is stated wrongly."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.droplets.droplet_table import Columns
from processing.analysis.shot_doubts import COMPONENTS
from processing.analysis.velocity.velocity_verdict import FASTEST_M_S
from processing.geometry import FloatArray

MOST_APART = 1.5
"""Ratio of the median speeds of the same droplets, by tracks and by both exposures of a shot."""


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
    speeds_m_s, paired_m_s = _speeds(tracks), _paired(tracks, shots)
    known = np.isfinite(speeds_m_s)
    if not known.any():
        return
    if (median_m_s := np.median(speeds_m_s[known])) > FASTEST_M_S:
        yield f"droplets fly at {median_m_s:.3g} m/s, faster than any spray: is the rate of {rate_hz:g} Hz right?"
    if (both := known & np.isfinite(paired_m_s)).any():
        by_tracks, by_pairs = np.median(speeds_m_s[both]), np.median(paired_m_s[both])
        if max(by_tracks, by_pairs) > MOST_APART * min(by_tracks, by_pairs):
            yield (
                f"droplets fly at {by_tracks:.3g} m/s from shot to shot, but at {by_pairs:.3g} m/s from A to B: is the "
                f"rate of {rate_hz:g} Hz right, and the separation?"
            )


def _speeds(columns: Columns) -> FloatArray:
    return np.asarray(np.linalg.norm([np.asarray(columns[name], np.float64) for name in COMPONENTS], axis=0))


def _paired(tracks: Columns, shots: Sequence[StoredDroplets]) -> FloatArray:
    """Speeds from A to B of the droplets on tracks; not a number where a droplet has none."""
    speeds_m_s = np.full(len(tracks["track"]), np.nan)
    for shot in shots:
        if COMPONENTS[0] in shot.columns:
            own: NDArray[np.bool_] = tracks["shot"] == shot.provenance["shot"]
            rows = tracks["droplet"][own].astype(np.intp)
            speeds_m_s[own] = _speeds(shot.columns)[shot.columns["frame"] == "a"][rows]
    return speeds_m_s
