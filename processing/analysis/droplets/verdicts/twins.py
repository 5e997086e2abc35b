"""Twins: as many droplets elsewhere, found again; what is found beside them are ghosts, as the exposure may have."""

from dataclasses import replace

import numpy as np

from processing.analysis.droplets.droplet_search import DropletSearch
from processing.analysis.droplets.ghost_share import GhostShare, matches
from processing.analysis.droplets.measured_exposure import MeasuredExposure, Rows, Seen
from processing.geometry import FloatArray

MANY_GHOSTS, SURE = 0.1, 1.0
"""Share in twins beyond which, by so many standard deviations of chance, a shot is doubtful: ghosts can explain images
as well as the truth does."""
TWIN_MOVE_VOXEL = 15.0
"""So far at most droplets of a twin are moved along every axis: chance alignments are new, density stays."""


def judged_by_twins(shot: MeasuredExposure[Rows, Seen], ghosts: GhostShare) -> MeasuredExposure[Rows, Seen]:
    """A shot with the ghosts of its twins; doubtful where they are many, however well droplets explain the images."""
    shot = replace(shot, twins=ghosts)
    if ghosts.share is None or ghosts.ghosts - SURE * np.sqrt(ghosts.ghosts) <= MANY_GHOSTS * ghosts.found:
        return shot
    reason = (
        f"of the droplets of a twin {100 * ghosts.share:.0f} % are ghosts, limit {100 * MANY_GHOSTS:.0f} %: too many "
        "droplets for so few views"
    )
    return shot.doubted((reason,))


def ghosts_within(found_voxel: FloatArray, truth_voxel: FloatArray, search: DropletSearch) -> GhostShare:
    """Ghosts among the found droplets (N, 3) within the grid of a search, in voxels of what is searched."""
    inside = search.holds(found_voxel)
    ghost = matches(found_voxel, truth_voxel)[0] < 0
    return GhostShare(int(np.count_nonzero(ghost & inside)), int(np.count_nonzero(inside)))


def moved(positions_voxel: FloatArray, search: DropletSearch, rng: np.random.Generator) -> FloatArray:
    """Positions of a twin: moved at random; what was within the grid, or in its margin, is reflected back into it."""
    low, high = search.ends_voxel
    inside = search.holds(positions_voxel)[:, None]
    least = np.where(inside, low, 0.0)
    most = np.where(inside, high, np.array(search.searched.shape[::-1]) - 1.0)
    there = positions_voxel + rng.uniform(-TWIN_MOVE_VOXEL, TWIN_MOVE_VOXEL, positions_voxel.shape)
    above = least + np.abs(there - least)
    back: FloatArray = np.clip(most - np.abs(most - above), least, most)
    return back
