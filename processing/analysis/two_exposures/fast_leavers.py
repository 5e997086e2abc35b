"""Droplets that fly far leave the box between A and B more often than others, and have no velocity then.

A mean over those that have one lacks them. In a box of length L a droplet that flies by d has a partner from a share
``1 - d / L`` of all places, along each axis; if each counts one over that, pairs stand for all droplets of the box.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from processing.analysis.droplets.droplet_file import FRAME, StoredDroplets
from processing.analysis.droplets.droplet_statistics import measured_grid
from processing.analysis.stored_json import stored_json
from processing.geometry import FloatArray
from processing.volume import VoxelGrid

MOST_SLOWER, FEWEST, SURE = 0.03, 20, 2.0
"""Share by which the mean speed of pairs may be below that of all; pairs, and standard deviations, to say so."""
LEAST_SHARE = 0.05
"""Of the places: no pair counts more than one over that."""
MM_PER_M_S_NS, NS = 1e-6, "separation_ns"


def leavers_told(velocities_m_s: FloatArray, weights: FloatArray, seen: int) -> Iterator[str]:
    """What is wrong with the mean of velocities; nothing where it is that of all droplets to a few percent.

    Parameters
    ----------
    velocities_m_s : (N, 3) array
        Of pairs.
    weights : (N,) array
        For how many droplets each of them stands, as ``leaving_weights`` says.
    seen : int
        Droplets of A: where fewer leave than half of what weights say, as at the tip of a spray, nothing is said.
    """
    if len(weights) < FEWEST or seen < (len(weights) + weights.sum()) / 2:
        return
    speeds_m_s = np.linalg.norm(velocities_m_s, axis=1)
    pairs_m_s, all_m_s = float(speeds_m_s.mean()), float(np.average(speeds_m_s, weights=weights))
    addends = weights / weights.mean() * (speeds_m_s - all_m_s) - (speeds_m_s - pairs_m_s)
    slower_m_s, sd_m_s = all_m_s - pairs_m_s, float(addends.std()) / np.sqrt(len(addends))
    if slower_m_s > max(MOST_SLOWER * all_m_s, SURE * sd_m_s):
        yield (
            "droplets that fly far leave the box between A and B more often than others, and have no velocity then: "
            f"the mean speed is {pairs_m_s:.3g} m/s of those that stay, but about {all_m_s:.3g} m/s of all; mean "
            "velocities and flux are too small. Shorten the separation, or measure a box that is longer along the way"
        )


def leaving_weights(velocities_m_s: FloatArray, separation_ns: float, grid: VoxelGrid) -> FloatArray:
    """For how many droplets each pair stands, as such ones leave a grid, (N,).

    Parameters
    ----------
    velocities_m_s : (N, 3) array
        Of pairs.
    separation_ns : float
        Time from A to B.
    grid : VoxelGrid
        In which both exposures were measured.
    """
    ways_mm = MM_PER_M_S_NS * separation_ns * np.abs(velocities_m_s)
    shares = np.prod(np.maximum(1 - ways_mm / (grid.pitch_mm * np.array(grid.shape[::-1])), 0), axis=1)
    return np.asarray(1 / np.maximum(shares, LEAST_SHARE))


def leavers_in_shots(flying: Sequence[tuple[StoredDroplets, FloatArray]]) -> Iterator[str]:
    """The same of all shots together, each with the velocities (N, 3) of its droplets of A."""
    known = [
        (rows, leaving_weights(rows, separation_ns, grid), np.count_nonzero(shot.columns[FRAME] == "a"))
        for shot, rows in flying
        if (grid := measured_grid(shot)) and (separation_ns := stored_json(shot.provenance, "velocity").get(NS))
    ]
    if known:
        velocities_m_s, weights, seen = zip(*known, strict=True)
        yield from leavers_told(np.concatenate(velocities_m_s), np.concatenate(weights), int(sum(seen)))
