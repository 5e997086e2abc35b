"""Disparity: by how much the views of a shot disagree on where its droplets are.

A droplet that n views see leaves 2 n - 3 residuals after triangulation. Combinations of droplets that are one
agree on all of them; false combinations are spread over the whole range. So the highest peak of the joint
histogram is the truth (Wieneke 2008 sums it view by view; seen jointly it stands out from far denser clouds).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from processing.calibration.calibration import Calibration
from processing.calibration.droplets.droplet_matching import MAX_SEEDS, Box, Matches, match_exposures
from processing.calibration.errors import CalibrationError, OutOfRange
from processing.calibration.triangulation import linearise, unseen
from processing.geometry import FloatArray, ViewMapping

SEARCH_PX = 4.0
"""Largest residual a drifted view may leave: room for drifts up to about 3 px."""
REACH_PX = 3.0
"""A drift that is found in any view and direction; in some further ones are."""
PEAK_RADIUS_PX = 0.5
"""Droplets of one peak lie so close to its middle, all views together: three times their scatter."""
MIN_DROPLETS = 12
"""A peak of fewer droplets may be chance."""
SIGNIFICANCE = 8.0
"""Standard deviations of the background by which a peak must exceed it."""
CLEARER = 2.0
"""A peak exceeds any that lies elsewhere so many times: chance alone makes several, of much the same height.

Droplets of false combinations come in groups (exposures A and B of a shot show the same ones), so that their
scatter cannot be told from their number.
"""
ELSEWHERE_PX = 4 * PEAK_RADIUS_PX
"""So far away a peak is another one, even if a view that has turned widens it."""
MIN_VIEWS = 3
"""Two views agree on every point of an epipolar line: they cannot tell a drift along it."""
SHOT_DIVISIONS = (2, 2, 2)
_MAX_CENTRES = 2000


@dataclass(frozen=True, eq=False)
class LocalDisparity:
    """What the views disagree by in one sub-volume.

    Parameters
    ----------
    point_mm : (3,) array
        Mean position of its droplets.
    disparity_px : (n, 2) array
        Seen minus re-projected, by view; mean of the peak.
    scatter_px : (n,) array
        Standard deviation of single droplets, per coordinate.
    n_droplets : int
        Droplets in the peak.
    """

    point_mm: FloatArray
    disparity_px: FloatArray
    scatter_px: FloatArray
    n_droplets: int


@dataclass(frozen=True)
class ViewDisparity:
    """Distance between where a view sees droplets and where all other views put them.

    Parameters
    ----------
    disparity_px : float
        Median over the sub-volumes; of a single drifted view this is its drift.
    uncertainty_px : float
        Standard uncertainty of it.
    left_px : float
        Rms disagreement of all views that would be left if this one alone had moved, and were put right.
    """

    disparity_px: float
    uncertainty_px: float
    left_px: float = math.nan

    @property
    def certain_px(self) -> float:
        """Disparity less its uncertainty: what is judged, so that few droplets of a dense spray are no alarm."""
        return max(0.0, self.disparity_px - self.uncertainty_px)


def measured_box(calibration: Calibration) -> Box:
    """The calibrated volume."""
    (x0, x1), (y0, y1), (z0, z1) = calibration.x_range_mm, calibration.y_range_mm, calibration.z_range_mm
    return Box((x0, y0, z0), (x1, y1, z1))


def local_disparities(
    mappings: Sequence[ViewMapping], matches: Matches, box: Box, divisions: tuple[int, int, int]
) -> list[LocalDisparity]:
    """Disparity of every sub-volume whose peak is significant.

    Parameters
    ----------
    mappings : sequence of ViewMapping
        The n views of the matches.
    matches : Matches
        Candidates, of as many shots as there are.
    box : Box
        The volume.
    divisions : tuple[int, int, int]
        Sub-volumes along x, y and z.
    """
    cells = box.cells(matches.points_mm, divisions)
    found = (_peak(matches, np.flatnonzero(cells == cell), len(mappings)) for cell in np.unique(cells))
    return [disparity for disparity in found if disparity is not None]


def shot_disparity(
    mappings: Sequence[ViewMapping], exposures: Sequence[Sequence[FloatArray]], box: Box, seeds: int = MAX_SEEDS
) -> tuple[ViewDisparity, ...]:
    """Disparity of every view in one shot.

    Parameters
    ----------
    mappings : sequence of ViewMapping
        The views as calibrated, at least three.
    exposures : sequence of sequences of (N, 2) arrays
        By exposure: the droplets of each view.
    box : Box
        The measured volume.
    seeds : int
        The brightest droplets of a view are followed, no more of them.

    Raises
    ------
    CalibrationError
        There are too few views or droplets, or none agree.
    OutOfRange
        A view has moved so far that the search range cuts off its droplets.
    """
    require_views(len(mappings))
    matches = match_exposures(mappings, exposures, box, SEARCH_PX, seeds)
    local = local_disparities(mappings, matches, box, SHOT_DIVISIONS) or local_disparities(
        mappings, matches, box, (1, 1, 1)
    )
    if not local:
        seen = ", ".join(str(sum(map(len, view))) for view in zip(*exposures, strict=True))
        raise CalibrationError(
            f"the views see {seen} droplets, of which no {MIN_DROPLETS} agree within {SEARCH_PX:g} px"
        )
    largest_px = max(float(np.linalg.norm(disparity.disparity_px, axis=1).max()) for disparity in local)
    if largest_px > SEARCH_PX - PEAK_RADIUS_PX:
        raise OutOfRange(f"droplets agree only at the edge of what is searched, {SEARCH_PX:g} px")
    projectors = [_projector(mappings, disparity.point_mm) for disparity in local]
    return tuple(_of_view(view, local, projectors) for view in range(len(mappings)))


def require_views(n_views: int) -> None:
    """Refuse fewer than three views."""
    if n_views < MIN_VIEWS:
        raise CalibrationError(f"{n_views} views cannot check each other, at least {MIN_VIEWS} are needed")


def against_others(mappings: Sequence[ViewMapping], point_mm: FloatArray) -> FloatArray:
    """Matrices (n, 2, 2) from the residual of each view to its distance from what the others see alone."""
    projector = _projector(mappings, point_mm)
    return np.stack([_against_others(projector, view) for view in range(len(mappings))])


def _projector(mappings: Sequence[ViewMapping], point_mm: FloatArray) -> FloatArray:
    return unseen(np.stack([linearise(mapping, point_mm[None])[1][0] for mapping in mappings]))


def _against_others(projector: FloatArray, view: int) -> FloatArray:
    span = slice(2 * view, 2 * view + 2)
    return np.asarray(np.linalg.pinv(projector[span, span]), dtype=np.float64)


def _of_view(view: int, local: Sequence[LocalDisparity], projectors: Sequence[FloatArray]) -> ViewDisparity:
    factors = [_against_others(projector, view) for projector in projectors]
    moved_px = [factor @ disparity.disparity_px[view] for disparity, factor in zip(local, factors, strict=True)]
    errors_px = [
        float(np.linalg.norm(factor, 2)) * disparity.scatter_px[view] / np.sqrt(disparity.n_droplets)
        for disparity, factor in zip(local, factors, strict=True)
    ]
    left_px = [
        disparity.disparity_px.ravel() - projector[:, 2 * view : 2 * view + 2] @ motion_px
        for disparity, projector, motion_px in zip(local, projectors, moved_px, strict=True)
    ]
    of_median = np.sqrt(np.pi / 2 / len(local)) if len(local) > 1 else 1.0
    return ViewDisparity(
        disparity_px=float(np.median(np.linalg.norm(moved_px, axis=1))),
        uncertainty_px=float(of_median * np.sqrt(np.mean(np.square(errors_px)))),
        left_px=float(np.sqrt(np.mean(np.square(left_px)))),
    )


def _peak(matches: Matches, rows: NDArray[np.intp], n_views: int) -> LocalDisparity | None:
    """The densest spot of the joint disparities; None where it does not stand out."""
    if len(rows) < MIN_DROPLETS:
        return None
    joint_px = matches.disparities_px[rows].reshape(len(rows), -1)
    tree = cKDTree(joint_px)
    candidates = joint_px[:: max(1, len(rows) // _MAX_CENTRES)]
    counts = np.asarray(tree.query_ball_point(candidates, PEAK_RADIUS_PX, return_length=True), dtype=np.intp)
    centre_px, members = _climbed(tree, candidates[int(np.argmax(counts))])
    around = len(tree.query_ball_point(centre_px, 2 * PEAK_RADIUS_PX)) - len(members)
    background = around / (2 ** (2 * n_views - 3) - 1)
    elsewhere = counts[np.linalg.norm(candidates - centre_px, axis=1) > ELSEWHERE_PX].max(initial=0)
    excess = max(SIGNIFICANCE * np.sqrt(background), CLEARER * (elsewhere - background))
    if len(members) < max(MIN_DROPLETS, background + excess):
        return None
    deviation_px = joint_px[members].reshape(len(members), n_views, 2) - centre_px.reshape(n_views, 2)
    scatter_px = np.sqrt((deviation_px**2).mean(axis=(0, 2)))
    point_mm = matches.points_mm[rows[members]].mean(axis=0)
    return LocalDisparity(point_mm, centre_px.reshape(n_views, 2), scatter_px, len(members))


def _climbed(tree: cKDTree, centre_px: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
    """Middle (2 n,) of the peak near a first guess, and which points of the tree belong to it."""
    joint_px = np.asarray(tree.data, dtype=np.float64)
    for _ in range(10):
        members = np.asarray(tree.query_ball_point(centre_px, PEAK_RADIUS_PX), dtype=np.intp)
        moved_px = joint_px[members].mean(axis=0)
        if np.abs(moved_px - centre_px).max() < 1e-4:
            break
        centre_px = moved_px
    return centre_px, members
