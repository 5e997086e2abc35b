"""Droplets of a single image: where in the image, how large, how sharp. In pixels; no depth, no volume."""

from collections import Counter
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.analysis.flat.blurred_disc import LEVELS, flattening, unblurred
from processing.analysis.flat.darkness import Darkness, Image, darkness_of
from processing.analysis.flat.edge_residuals import edge_residuals
from processing.analysis.flat.faint_spots import faint_diameters
from processing.analysis.flat.flat_settings import FlatSettings
from processing.analysis.flat.judged_spots import LeftOut, MeasuredSpot, SeenSpot, judged_spot
from processing.analysis.flat.outline import Outline, outline_around
from processing.analysis.flat.spots import Spot, find_spots
from processing.analysis.flat.whole_share import whole_shares
from processing.geometry import FloatArray
from processing.grey_image import require_image

ROUNDS = 3
"""Of the light around a droplet and its outline, which depend on one another."""
NOISES = 6.0
"""A spot must stand out by so many standard deviations of the noise of the smoothed image."""
MOST_SATURATED = 0.05
"""Share of the area of a bright particle; a Gaussian one whose height is clipped there is 3 % too large."""
SMOOTHED_NOISE = 1 / 3
"""Of the noise of a pixel, in the mean of 3 x 3."""


@dataclass(frozen=True, eq=False)
class FlatDroplets:
    """Droplets of one image.

    Parameters
    ----------
    centres_px : (N, 2) array
        Column and row.
    diameters_px : (N,) array
        Of the disc that, blurred, has the outlines that are seen.
    raw_diameters_px : (N,) array
        Of a circle as large as the outline at half of the droplet's own depth.
    blur_px : (N,) array
        Standard deviation of the blur of its edge: small is sharp.
    depths : (N,) array
        How much darker it is than what is around it, relative to the light.
    circularity : (N,) array
        4 pi area over perimeter squared, of the outline.
    overlapping : (N,) bool array
        Another shadow reaches into the outline; where it is that of several discs, each is the largest that finds
        room in it, and its blur is not a number.
    whole_shares : (N,) array
        Share of the image in which the centre of one as large may lie if it is seen whole.
    edge_residuals : (N,) array
        Standard deviation, beyond the noise, of what the blurred disc leaves of the image at its edge, of its depth;
        not a number where it overlaps.
    left_out : dict of reason to number
        What was seen and is not among them: ``border``, ``not_round``, ``unsharp``, ``small``, ``faint``,
        ``saturated``.
    image_size_px : int, int
        Columns and rows of the image.
    lacking_px : (M,) array
        About how large those are that were left out as ``unsharp``, ``small`` or ``faint``.
    """

    centres_px: FloatArray
    diameters_px: FloatArray
    raw_diameters_px: FloatArray
    blur_px: FloatArray
    depths: FloatArray
    circularity: FloatArray
    overlapping: NDArray[np.bool_]
    whole_shares: FloatArray
    edge_residuals: FloatArray
    left_out: dict[str, int]
    image_size_px: tuple[int, int] = (0, 0)
    lacking_px: FloatArray = field(default_factory=lambda: np.empty(0))

    @classmethod
    def none(cls) -> "FlatDroplets":
        """No droplets."""
        empty = np.empty(0)
        return cls(np.empty((0, 2)), empty, empty, empty, empty, empty, np.empty(0, bool), empty, empty, {})

    def __len__(self) -> int:
        return len(self.diameters_px)

    def columns(self) -> dict[str, NDArray[np.generic]]:
        """Columns by their names, as files have them."""
        return {
            "x_px": self.centres_px[:, 0],
            "y_px": self.centres_px[:, 1],
            "diameter_px": self.diameters_px,
            "diameter_raw_px": self.raw_diameters_px,
            "blur_px": self.blur_px,
            "depth": self.depths,
            "circularity": self.circularity,
            "overlapping": self.overlapping.astype(np.uint8),
            "whole_share": self.whole_shares,
            "edge_residual": self.edge_residuals,
        }


def measure_flat(
    image: NDArray[np.generic],
    settings: FlatSettings | None = None,
    background: NDArray[np.generic] | None = None,
    saturated: NDArray[np.bool_] | None = None,
) -> FlatDroplets:
    """Measure the droplets of one image.

    Parameters
    ----------
    image : (rows, columns) array
        Grey values, less the dark image.
    settings : FlatSettings, optional
        How.
    background : (rows, columns) array, optional
        The light without droplets; by default a smooth one is fitted. A white frame around the image is no light.
    saturated : (rows, columns) bool array, optional
        Pixels at full scale, where a dark image was taken off; by default those at the end of some camera's scale.

    Raises
    ------
    LightError
        There is no light that droplets could be dark before.
    ValueError
        What is given is no image of grey values, or the two differ in shape.
    """
    require_image("image", image)
    if background is not None:
        require_image("background", background)
        if np.shape(background) != np.shape(image):
            raise ValueError(f"background image {np.shape(background)} does not fit the image {np.shape(image)}")
    how = settings or FlatSettings()
    seen = darkness_of(image, how.polarity, background, saturated)
    smoothed = cv2.blur(seen.values, (3, 3)).astype(np.float32)
    least = max(how.least_depth, NOISES * SMOOTHED_NOISE * seen.noise)
    spots = find_spots(smoothed, 0.5 * least, least)
    results = _measured_once(seen, smoothed, spots, how, least)
    results += [LeftOut("faint", size_px) for size_px in faint_diameters(seen.values, smoothed, least).tolist()]
    lacking = [result for result in results if isinstance(result, LeftOut)]
    sized_px = np.array([one.diameter_px for one in lacking if one.diameter_px is not None], np.float64)
    told = [result for result in results if isinstance(result, MeasuredSpot)]
    table = np.array([one.row for one in told], dtype=np.float64).reshape(-1, 8)
    return FlatDroplets(
        centres_px=table[:, :2] + (seen.first_column, seen.first_row),
        diameters_px=table[:, 2],
        raw_diameters_px=table[:, 3],
        blur_px=table[:, 4],
        depths=table[:, 5],
        circularity=table[:, 6],
        overlapping=table[:, 7] > 0,
        whole_shares=whole_shares(table[:, 2], seen.values.shape),
        left_out=dict(Counter(one.reason for one in lacking)),
        edge_residuals=_edge_residuals(seen, told),
        lacking_px=sized_px,
        image_size_px=(np.shape(image)[1], np.shape(image)[0]),
    )


def _edge_residuals(seen: Darkness, told: list[MeasuredSpot]) -> FloatArray:
    """Of those that overlap no other; of several discs that make an outline together the blur is not known, either."""
    discs = {index: disc for index, one in enumerate(told) if (disc := one.disc) is not None}
    residuals = np.full(len(told), np.nan)
    residuals[list(discs)] = edge_residuals(seen.values, seen.noise, list(discs.values()))
    return np.where([one.overlapping for one in told], np.nan, residuals)


def _measured_once(
    seen: Darkness, smoothed: Image, spots: list[Spot], how: FlatSettings, least: float
) -> list[MeasuredSpot | LeftOut]:
    """All spots; one whose outline goes around a spot that was measured already is part of that."""
    results: list[MeasuredSpot | LeftOut] = []
    taken: set[tuple[int, int]] = set()
    for spot in spots:
        found = _outlined(seen.values, smoothed, spot, least)
        if isinstance(found, LeftOut):
            results.append(found)
        elif found is not None and how.polarity == "bright" and _saturated(found.outline, seen.saturated):
            results.append(LeftOut("saturated"))
        elif found is not None:
            row, column = (round(coordinate) for coordinate in found.outline.centre_px)
            results += [] if (row, column) in taken else judged_spot(found, how)
            taken.add((row, column))
    return results


def _outlined(values: Image, smoothed: Image, spot: Spot, least: float) -> SeenSpot | LeftOut | None:
    """What is seen of a spot; ``border`` where that goes on beyond the image, None where it does not stand out."""
    light = 0.0
    for _ in range(ROUNDS):
        depth = spot.peak - light
        if depth < least:
            return None
        if merged := light + LEVELS[1] * depth < spot.base and spot.base > 0.5 * least:
            light, depth = spot.base, spot.peak - spot.base
            break
        middle = _outline(values, light + LEVELS[1] * depth, spot)
        if middle is None:
            return LeftOut("border")
        light = _light_around(smoothed, middle, light)
    disturbed = merged or max(light, spot.base - light) > LEVELS[0] * depth
    first = _at_levels(values, light, depth, spot, disturbed)
    if first is None:
        return LeftOut("border")
    return _at_levels(values, light, depth / flattening(*unblurred(first.radii_px)), spot, disturbed) or first


def _at_levels(values: Image, light: float, depth: float, spot: Spot, disturbed: bool) -> SeenSpot | None:
    """Outlines of a spot; the outer one is mirrored from the inner one where something else is in the way."""
    outer, middle, inner = (_outline(values, light + level * depth, spot) for level in LEVELS)
    if middle is None:
        return None
    half_px, inner_px = middle.radius_px, (inner or middle).radius_px
    outer_px = 2 * half_px - inner_px if disturbed or outer is None else outer.radius_px
    return SeenSpot(middle, (outer_px, half_px, inner_px), depth, disturbed)


def _outline(values: Image, level: float, spot: Spot) -> Outline | None:
    """The outline around a spot, looked for in a part of the image that grows until it holds it."""
    first_row, first_column, rows, columns = spot.box
    pad = 4 + max(rows, columns) // 2
    while True:
        top, left = max(first_row - pad, 0), max(first_column - pad, 0)
        part = values[top : first_row + rows + pad, left : first_column + columns + pad]
        found = outline_around(part, level, (spot.row - top, spot.column - left))
        if found is not None:
            return Outline(found.points + (top, left))
        if part.shape == values.shape or pad > max(values.shape):
            return None
        pad *= 3


def _light_around(smoothed: Image, outline: Outline, before: float) -> float:
    """Darkness of what is around a droplet: the median of a ring that its blur does not reach."""
    (row, column), radius_px = outline.centre_px, outline.radius_px
    near, far = 1.6 * radius_px + 2, 2.2 * radius_px + 5
    top, left = max(int(row - far), 0), max(int(column - far), 0)
    part = smoothed[top : int(row + far) + 2, left : int(column + far) + 2]
    v, u = np.ogrid[: part.shape[0], : part.shape[1]]
    distance = np.hypot(v + top - row, u + left - column)
    ring = part[(distance >= near) & (distance <= far)]
    return float(np.median(ring)) if ring.size else before


def _saturated(outline: Outline, saturated: NDArray[np.bool_]) -> bool:
    """Whether so much of a particle is at full scale that its height is unknown, and so is its outline at half."""
    (top, left), (bottom, right) = outline.points.min(axis=0), outline.points.max(axis=0)
    within = saturated[int(top) : int(bottom) + 2, int(left) : int(right) + 2]
    return int(np.count_nonzero(within)) > MOST_SATURATED * outline.area_px2
