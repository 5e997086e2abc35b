"""How objects move from one exposure to the other: the displacement that makes their silhouettes alike in all views.

Correlation in 3-D, done where the information is. A hull is longer along the views' common direction than what made it,
and its ghosts move otherwise; silhouettes are right. So for every displacement the images of A, where the object is
dark, are compared with those of B at the pixels that this displacement leads to, all views added up.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, spline_filter

from processing.geometry import FloatArray, ViewMapping
from processing.preprocessing import Intensity

REACH_PX = 25
"""Displacements are looked for as far as those of droplets."""
BESIDE_PX = 3
"""So far around what is dark are the edges, which tell the place."""
STEP_PX = 1.5
"""Of displacements that are tried first."""
APART_PX = 5.0
"""From there on a displacement is another one."""
LEAST_RATIO = 1.5
"""Of what any other displacement leaves unlike, over what the best one does."""
MOST_UNLIKE = 0.2
"""What the best displacement leaves, over the squares of the darkness of the object."""
LEAST_VIEWS = 3
MOST_STEPS, STILL_PX, STEP_MM = 12, 1e-3, 1e-3
TOGETHER = 2.5
"""So many pixels err as one where other shadows lie over an object: by simulated threads and films among droplets."""
OUTLYING, LEAST_NOISE = 3.0, 1e-3
"""What is unlike by so many times the median, and some noise, has half the weight: something else covers the object."""
GOES_BEYOND = "fewer than three views see all of it"
CHANGED = "nothing in B is like it: it went too far, changed, or is hidden"
NOT_UNIQUE = "several displacements are as likely"
DISAGREE = "other shadows lie over it: without one view it would have moved elsewhere"
MOST_APART_PX = 0.1
"""So far a displacement may be from what it would be without one of the views: among 900 threads in 8 to 20 droplets
per mm^3 all that were wrong by more than 0.2 px were farther apart."""
JACKKNIFE = 0.5
"""So much of the variance that leaving out each view tells (Tukey's jackknife) comes on top of that of the noise."""


@dataclass(frozen=True, eq=False)
class ObjectMotions:
    """Displacements of N objects.

    Parameters
    ----------
    moved_mm : (N, 3) array
        x, y, z; not a number where there is none.
    covariance_mm2 : (N, 3, 3) array
        By what the views leave unlike, by how they disagree, and by what each of them changes.
    reasons : (N,) array of str
        Why there is none; empty where there is one.
    """

    moved_mm: FloatArray
    covariance_mm2: FloatArray
    reasons: NDArray[np.str_]


@dataclass(frozen=True, eq=False)
class _Sight:
    """What a view sees of an object.

    Parameters
    ----------
    pixels : (M, 2) array
        Row and column of those that show it, in ``after``.
    before : (M,) array
        How dark they are in the first exposure.
    after : (rows, columns) array
        Darkness of the second exposure around it, as coefficients of splines.
    slopes : (2, 3) array
        Along rows and columns, in px per mm.
    unlike : (rows, columns) array
        Sum of squares of what is unlike after a shift by whole pixels; no shift is in its middle.
    """

    pixels: FloatArray
    before: FloatArray
    after: FloatArray
    slopes: FloatArray
    unlike: FloatArray

    def rest(self, moved_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What is unlike (M,), and how it changes with the displacement (M, 3)."""
        places = (self.pixels + self.slopes @ moved_mm).T
        value = map_coordinates(self.after, places, order=3, prefilter=False)
        ahead, behind = (
            [map_coordinates(self.after, places + step[:, None], order=3, prefilter=False) for step in steps]
            for steps in (HALF_PX, -HALF_PX)
        )
        return value - self.before, np.stack(ahead, 1) @ self.slopes - np.stack(behind, 1) @ self.slopes


HALF_PX = 0.5 * np.eye(2)


def object_motions(
    before: Sequence[Intensity],
    after: Sequence[Intensity],
    mappings: Sequence[ViewMapping],
    bodies: Sequence[FloatArray],
    reach_px: int = REACH_PX,
) -> ObjectMotions:
    """Displacements of objects from one exposure to the other.

    Parameters
    ----------
    before, after : sequences of (rows, columns) float32 arrays
        Transmissions of the two exposures, one per view.
    mappings : sequence of ViewMapping
        Of the views.
    bodies : sequence of (M, 3) arrays
        Voxels of the hull of each object in the first exposure, in mm.
    reach_px : int
        Displacements are looked for as far as that.
    """
    dark, later = ([np.pad(1 - image, reach_px + BESIDE_PX) for image in images] for images in (before, after))
    found = [_moved(dark, later, mappings, body_mm, reach_px) for body_mm in bodies]
    moved, covariance = np.full((len(bodies), 3), np.nan), np.full((len(bodies), 3, 3), np.nan)
    for number, one in enumerate(found):
        if not isinstance(one, str):
            moved[number], covariance[number] = one
    reasons = [one if isinstance(one, str) else "" for one in found]
    return ObjectMotions(moved, covariance, np.array(reasons, np.str_))


def _moved(
    before: Sequence[Intensity],
    after: Sequence[Intensity],
    mappings: Sequence[ViewMapping],
    body_mm: FloatArray,
    reach_px: int,
) -> tuple[FloatArray, FloatArray] | str:
    """Displacement and covariance, or why there is none."""
    views = zip(before, after, mappings, strict=True)
    sights = [one for view in views if (one := _sight(*view, body_mm, reach_px)) is not None]
    if len(sights) < LEAST_VIEWS:
        return GOES_BEYOND
    tried_mm, unlike = _tried(sights, reach_px)
    fit = _fitted(sights, tried_mm[np.argmin(unlike)])
    left = _left(sights, fit.moved_mm)
    if left > MOST_UNLIKE * sum(float(np.sum(one.before**2)) for one in sights):
        return CHANGED
    others = np.flatnonzero(_are_apart(sights, tried_mm, fit.moved_mm))
    rival = _fitted(sights, tried_mm[others[np.argmin(unlike[others])]])
    if _are_apart(sights, rival.moved_mm, fit.moved_mm) and _left(sights, rival.moved_mm) < LEAST_RATIO * left:
        return NOT_UNIQUE
    apart_mm = _without_each(sights, fit.moved_mm) - fit.moved_mm
    if np.linalg.norm(apart_mm, axis=1).max() * _scale(sights) > MOST_APART_PX:
        return DISAGREE
    jackknife_mm2 = (len(sights) - 1) / len(sights) * apart_mm.T @ apart_mm
    return fit.moved_mm, fit.covariance_mm2 + JACKKNIFE * jackknife_mm2


def _without_each(sights: Sequence[_Sight], moved_mm: FloatArray) -> FloatArray:
    """Displacements (views, 3) as they would be without each of the views."""
    others = ([one for one in sights if one is not left_out] for left_out in sights)
    return np.array([_fitted(seen, moved_mm).moved_mm for seen in others])


def _left(sights: Sequence[_Sight], moved_mm: FloatArray) -> float:
    """What is unlike after a displacement, in all views."""
    return sum(float(np.sum(one.rest(moved_mm)[0] ** 2)) for one in sights)


def _are_apart(sights: Sequence[_Sight], some_mm: FloatArray, moved_mm: FloatArray) -> NDArray[np.bool_]:
    """Which displacements (..., 3) are others."""
    return np.asarray(np.linalg.norm(some_mm - moved_mm, axis=-1) * _scale(sights) > APART_PX)


def _sight(
    before: Intensity, after: Intensity, mapping: ViewMapping, body_mm: FloatArray, reach_px: int
) -> _Sight | None:
    """What a view sees of a body; None where it is partly beyond the image."""
    seen_px = np.rint(mapping.project(body_mm)).astype(np.int64)[:, ::-1]
    if np.any(seen_px < 0) or np.any(seen_px >= np.array(mapping.image_size_px)[::-1]):
        return None
    corner = seen_px.min(axis=0) - BESIDE_PX
    shape = seen_px.max(axis=0) + BESIDE_PX + 1 - corner
    mask = np.zeros(shape, np.uint8)
    mask[tuple((seen_px - corner).T)] = 1
    mask = cv2.dilate(mask, np.ones((2 * BESIDE_PX + 1,) * 2, np.uint8))
    first = corner + BESIDE_PX  # of the region around the object in the padded images
    region = after[tuple(slice(a, a + n + 2 * reach_px) for a, n in zip(first, shape, strict=True))]
    template = before[tuple(slice(a, a + n) for a, n in zip(first + reach_px, shape, strict=True))]
    return _Sight(
        pixels=(np.argwhere(mask) + reach_px).astype(np.float64),
        before=template[mask > 0].astype(np.float64),
        after=spline_filter(region.astype(np.float64), order=3),
        slopes=_slopes(mapping, body_mm.mean(axis=0)),
        unlike=cv2.matchTemplate(region, template, cv2.TM_SQDIFF, mask=mask.astype(np.float32)).astype(np.float64),
    )


def _slopes(mapping: ViewMapping, middle_mm: FloatArray) -> FloatArray:
    """How motion (x, y, z) in mm is seen along rows and columns: (2, 3)."""
    ahead_px, behind_px = (mapping.project(middle_mm + sign * STEP_MM * np.eye(3)) for sign in (1, -1))
    return np.asarray((ahead_px - behind_px).T[::-1] / (2 * STEP_MM), dtype=np.float64)


def _scale(sights: Sequence[_Sight]) -> float:
    """Pixels per mm."""
    return float(np.mean([np.linalg.norm(one.slopes[0]) for one in sights]))


def _tried(sights: Sequence[_Sight], reach_px: int) -> tuple[FloatArray, FloatArray]:
    """Displacements (N, 3) within reach, and what each of them leaves unlike (N,) in all views."""
    steps = np.arange(-reach_px, reach_px + STEP_PX / 2, STEP_PX)
    grid = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    tried_mm = grid[np.linalg.norm(grid, axis=1) <= reach_px] / _scale(sights)
    unlike = [
        map_coordinates(one.unlike, reach_px + one.slopes @ tried_mm.T, order=1, mode="nearest") for one in sights
    ]
    return tried_mm, np.asarray(np.sum(unlike, axis=0))


@dataclass(frozen=True, eq=False)
class _Fit:
    """A displacement, and what the views say of it.

    Parameters
    ----------
    moved_mm : (3,) array
        The displacement.
    information : (views, 3, 3) array
        Of each view, per mm squared, times the variance of a pixel.
    pulls : (views, 3) array
        Where each view would have it, likewise.
    variance : float
        Of a pixel, by what is left unlike.
    """

    moved_mm: FloatArray
    information: FloatArray
    pulls: FloatArray
    variance: float

    @classmethod
    def at(cls, sights: Sequence[_Sight], moved_mm: FloatArray) -> "_Fit":
        """What is known at a displacement. What is unlike by chance has full weight, what covers the object little."""
        rests, changes = zip(*(one.rest(moved_mm) for one in sights), strict=True)
        scale = OUTLYING * 1.4826 * float(np.median(np.abs(np.concatenate(rests)))) + LEAST_NOISE
        weights = [1 / (1 + (rest / scale) ** 2) for rest in rests]
        weighted = [change * weight[:, None] for change, weight in zip(changes, weights, strict=True)]
        squares = sum(float(weight @ rest**2) for weight, rest in zip(weights, rests, strict=True))
        return cls(
            moved_mm,
            np.array([one.T @ change for one, change in zip(weighted, changes, strict=True)]),
            np.array([-one.T @ rest for one, rest in zip(weighted, rests, strict=True)]),
            squares / sum(float(weight.sum()) for weight in weights),
        )

    @property
    def step_mm(self) -> FloatArray:
        """To where the views together would have it."""
        return np.asarray(np.linalg.pinv(self.information.sum(axis=0), hermitian=True) @ self.pulls.sum(axis=0))

    @property
    def covariance_mm2(self) -> FloatArray:
        """By what is left unlike, or by how much more the views disagree (Birge, Phys. Rev. 40, 207, 1932)."""
        own = np.linalg.pinv(self.information, hermitian=True)
        disagreement = float(np.einsum("ki,kij,kj", self.pulls, own, self.pulls)) / (2 * len(own) - 3)
        together = np.linalg.pinv(self.information.sum(axis=0), hermitian=True)
        return np.asarray(together * max(TOGETHER * self.variance, disagreement))


def _fitted(sights: Sequence[_Sight], moved_mm: FloatArray) -> _Fit:
    """The displacement that leaves least unlike, from one near it, by Gauss and Newton's steps."""
    for _ in range(MOST_STEPS):
        step_mm = _Fit.at(sights, moved_mm).step_mm
        moved_mm = moved_mm + step_mm
        if np.linalg.norm(step_mm) * _scale(sights) < STILL_PX:
            break
    return _Fit.at(sights, moved_mm)
