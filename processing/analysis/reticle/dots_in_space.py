"""Dots of all views put together: where they lie in space, on which plane, and the ellipse each is in every view."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.gaussian_blobs import Image
from processing.analysis.droplets.image_noise import noise_of
from processing.analysis.flat.spots import Spot, find_spots
from processing.analysis.reticle.elliptic_dots import Ellipse
from processing.analysis.reticle.size_groups import LEAST_DOTS, ReticleError
from processing.calibration.droplets.droplet_matching import Box, match_droplets
from processing.geometry import FloatArray, ViewMapping

LEAST_DEPTH, NOISES = 0.08, 8.0
"""A dot is darker by so much of the light, and by so many standard deviations of the noise of a pixel."""
PAD_PX = 3
LEAST_VIEWS = 2
TOLERANCE_PX = 1.5
"""A dot of one view may lie so far beside those of the others."""
FLAT_PX = 3.0
"""So far a dot may lie beside the plane, in pixels of the object."""
TRIALS = 500
"""Planes through three dots that are tried."""
STEP_MM = 0.01
"""Of numerical derivatives."""


@dataclass(frozen=True, eq=False)
class SeenDots:
    """Dots of one view.

    Parameters
    ----------
    middles_px : (N, 2) array
        Columns and rows.
    radii_px : (N,) array
        Of circles that take as much light.
    """

    middles_px: FloatArray
    radii_px: FloatArray


@dataclass(frozen=True, eq=False)
class PlaneDots:
    """Dots of K views on a plane.

    Parameters
    ----------
    points_mm : (N, 3) array
        Where they lie.
    axes_mm : (2, 3) array
        Two directions of the plane.
    numbers : (N, K) array
        Which dots of the views they are.
    """

    points_mm: FloatArray
    axes_mm: FloatArray
    numbers: NDArray[np.intp]

    @property
    def normal(self) -> FloatArray:
        """Of the plane, (3,), along +z."""
        normal = np.cross(*self.axes_mm)
        return np.asarray(normal * np.copysign(1, normal[2]), dtype=np.float64)

    def circles_px_per_mm(self, mapping: ViewMapping) -> FloatArray:
        """Matrices (N, 2, 2) that make outlines, in pixels, of circles on the plane, in mm."""
        sides = [
            (mapping.project(self.points_mm + STEP_MM * axis) - mapping.project(self.points_mm - STEP_MM * axis))
            for axis in self.axes_mm
        ]
        return np.stack(sides, axis=2) / (2 * STEP_MM)


def seen_dots(image: Image, known: NDArray[np.bool_]) -> SeenDots:
    """Dots of one view, without those at its border or where nothing is known.

    Parameters
    ----------
    image : (rows, columns) float32 array
        Light over that of the background.
    known : (rows, columns) bool array
        Where that is known.
    """
    darkness = np.where(known, 1 - image, 0).astype(np.float32)
    smoothed = cv2.blur(darkness, (3, 3)).astype(np.float32)
    least = max(LEAST_DEPTH, NOISES * noise_of(image))
    rows = [_weighed(darkness, known, spot) for spot in find_spots(smoothed, 0.5 * least, least)]
    table = np.array([row for row in rows if row is not None], dtype=np.float64).reshape(-1, 3)
    return SeenDots(table[:, :2], np.sqrt(table[:, 2] / np.pi))


def _weighed(darkness: Image, known: NDArray[np.bool_], spot: Spot) -> tuple[float, float, float] | None:
    """Column and row of the middle, and the light that is taken, in pixels; None at a border."""
    row, column, rows, columns = spot.box
    window = np.s_[row - PAD_PX : row + rows + PAD_PX, column - PAD_PX : column + columns + PAD_PX]
    if row < PAD_PX or column < PAD_PX or known[window].shape != (rows + 2 * PAD_PX, columns + 2 * PAD_PX):
        return None
    if not known[window].all():
        return None
    taken = np.maximum(darkness[window], 0).astype(np.float64)
    total = taken.sum()
    v, u = np.indices(taken.shape)
    return float((u * taken).sum() / total) + column - PAD_PX, float((v * taken).sum() / total) + row - PAD_PX, total


def dots_on_plane(mappings: Sequence[ViewMapping], seen: Sequence[SeenDots], box: Box) -> PlaneDots:
    """The plane that most dots lie on, and those dots.

    Parameters
    ----------
    mappings : sequence of ViewMapping
        The K views.
    seen : sequence of SeenDots
        In the same order.
    box : Box
        Where the reticle may be.

    Raises
    ------
    ReticleError
        Too few dots of all views lie on one plane, or there is one view alone.
    """
    if len(seen) < LEAST_VIEWS:
        raise ReticleError(f"a reticle is measured by {LEAST_VIEWS} views at least: they tell its plane; here is one")
    matches = match_droplets(mappings, [dots.middles_px for dots in seen], box, TOLERANCE_PX)
    if len(matches) < LEAST_DOTS:
        raise ReticleError(_too_few(seen, len(matches)))
    scale_px_per_mm = np.sqrt(abs(np.linalg.det(_across(mappings[0], box.middle_mm))))
    flat = _on_one_plane(matches.points_mm, FLAT_PX / scale_px_per_mm)
    numbers = np.stack(
        [
            np.argmin(np.linalg.norm(dots.middles_px - (mapping.project(point) + beside), axis=1))
            for point, disparities in zip(matches.points_mm, matches.disparities_px, strict=True)
            for mapping, dots, beside in zip(mappings, seen, disparities, strict=True)
        ]
    ).reshape(len(matches), len(mappings))
    order = np.flatnonzero(flat)[np.argsort(np.square(matches.disparities_px[flat]).sum(axis=(1, 2)))]
    kept = _each_once(order, numbers)
    if len(kept) < LEAST_DOTS:
        raise ReticleError(_too_few(seen, len(kept)))
    points_mm = matches.points_mm[kept]
    axes_mm = np.linalg.svd(points_mm - points_mm.mean(axis=0))[2][:2]
    return PlaneDots(points_mm, axes_mm, numbers[kept])


def _too_few(seen: Sequence[SeenDots], found: int) -> str:
    counts = ", ".join(str(len(dots.radii_px)) for dots in seen)
    return (
        f"{found} dots lie on one plane in all views, which see {counts}: at least {LEAST_DOTS} are needed; is the "
        "reticle within the calibrated volume and in every view, and is the calibration that of these views?"
    )


def _across(mapping: ViewMapping, middle_mm: FloatArray) -> FloatArray:
    """Pixels per mm along x and y, (2, 2)."""
    steps = STEP_MM * np.eye(3)[:2]
    return np.asarray((mapping.project(middle_mm + steps) - mapping.project(middle_mm - steps)).T / (2 * STEP_MM))


def _on_one_plane(points_mm: FloatArray, tolerance_mm: float) -> NDArray[np.bool_]:
    """Points of the plane through three of them that has most."""
    rng = np.random.default_rng(0)
    best = np.zeros(len(points_mm), np.bool_)
    for _ in range(TRIALS):
        first, second, third = points_mm[rng.choice(len(points_mm), 3, replace=False)]
        normal = np.cross(second - first, third - first)
        length = np.linalg.norm(normal)
        if length < tolerance_mm**2:
            continue
        near = np.abs((points_mm - first) @ normal / length) < tolerance_mm
        if near.sum() > best.sum():
            best = near
    return best


def _each_once(order: NDArray[np.intp], numbers: NDArray[np.intp]) -> NDArray[np.intp]:
    """Matches in their order, without those that use a dot of a view again."""
    used: set[tuple[int, int]] = set()
    kept = []
    for match in order:
        dots = set(enumerate(numbers[match].tolist()))
        if not dots & used:
            used |= dots
            kept.append(match)
    return np.array(kept, dtype=np.intp)


def ellipses(dots: PlaneDots, mapping: ViewMapping, radii_mm: FloatArray) -> list[Ellipse]:
    """Outlines of dots in a view."""
    circles = dots.circles_px_per_mm(mapping)
    return [Ellipse.of(radius_mm * circle) for circle, radius_mm in zip(circles, radii_mm, strict=True)]
