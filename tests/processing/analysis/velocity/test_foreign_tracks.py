"""Tracks of real particles that another program has linked: MyPTV's example, seven frames of about 40 particles."""

import os
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.analysis.velocity.track_doubts import uneven_doubts
from processing.analysis.velocity.tracks import link

pytestmark = pytest.mark.skipif(
    "TOMOSHADOW_DATA" not in os.environ, reason="TOMOSHADOW_DATA does not name a folder of foreign data sets"
)
TRAJECTORY, FRAME = 0, -1
VOXEL_MM = 0.2
"""About as exact as these particles are, by the same blobs triangulated otherwise."""
SD_MM = (0.05, 0.05, 0.1)
Link = tuple[tuple[int, int], tuple[int, int]]


def links(ids: list[np.ndarray]) -> set[Link]:
    """Pairs of (frame, row) that follow each other on a track."""
    seen: dict[int, list[tuple[int, int]]] = {}
    for frame, tracks in enumerate(ids):
        for row, track in enumerate(tracks.tolist()):
            if track >= 0:
                seen.setdefault(track, []).append((frame, row))
    return {pair for chain in seen.values() for pair in pairwise(chain)}


def test_all_links_of_myptv_are_found() -> None:
    rows = np.loadtxt(Path(os.environ["TOMOSHADOW_DATA"]) / "myptv_3cam_dotplate" / "trajectories")
    frames = [rows[rows[:, FRAME] == number] for number in range(7)]
    covariance = np.diag(np.square(SD_MM)) / VOXEL_MM**2
    moving = [
        MovingDroplets(one[:, 1:4] / VOXEL_MM, np.tile(covariance, (len(one), 1, 1)), np.zeros(len(one)))
        for one in frames
    ]
    linked = link(moving)
    theirs, ours = links([one[:, TRAJECTORY].astype(int) for one in frames]), links(list(linked.ids))
    assert len(theirs) == 212
    assert theirs <= ours
    assert len(ours) <= len(theirs) + 10  # of particles that they left alone
    assert list(uneven_doubts(moving, linked.ids, 0)) == []
