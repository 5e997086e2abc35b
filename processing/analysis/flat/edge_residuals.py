"""What told discs leave of an image at their edges: little, where a droplet is a blurred disc, or an ellipse.

Rings, steps of grey, a threshold and two droplets that are told as one have other edges, and other diameters.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.analysis.flat.blurred_disc import profile
from processing.geometry import FloatArray

INSIDE_BLURS, OUTSIDE_BLURS, PIXEL_PX = 3.0, 1.0, 1.0
"""From the edge inwards and outwards, and a pixel more: what is farther in moves no outline, and may be a glare."""
RING_PX = 2.0
"""Width of the ring beyond, whose median is the light there."""
_STEP_PX = 0.1


@dataclass(frozen=True, eq=False)
class ToldDisc:
    """A droplet as it is told.

    Parameters
    ----------
    row, column, radius_px, blur_px : float
        Of the disc, in the part of the image that is looked at.
    depth : float
        Darkness in its middle, beyond what is around it.
    stretch : (2, 2) array
        Makes the ellipse that its outline is a circle as large; rows first.
    """

    row: float
    column: float
    radius_px: float
    blur_px: float
    depth: float
    stretch: FloatArray


def edge_residuals(values: NDArray[np.float32], noise: float, discs: Sequence[ToldDisc]) -> FloatArray:
    """What discs leave at their edges beyond the noise.

    Parameters
    ----------
    values : (rows, columns) array
        Darkness.
    noise : float
        Standard deviation of ``values`` where there is no droplet.
    discs : sequence of ToldDisc
        All that are told.

    Returns
    -------
    (N,) array
        Standard deviation of what is left at the edge of each, of its depth; 0 where that is no more than the noise.
    """
    left = np.array(values, np.float64)
    for disc in discs:
        part, distances_px = _around(left.shape, disc)
        left[part] -= disc.depth * _darkness(disc, distances_px)
    return np.array([_edge_residual(left, noise, disc) for disc in discs], np.float64)


def _edge_residual(left: FloatArray, noise: float, disc: ToldDisc) -> float:
    part, distances_px = _around(left.shape, disc)
    beyond_px, beside = distances_px - disc.radius_px, left[part]
    outside_px = OUTSIDE_BLURS * disc.blur_px + PIXEL_PX
    edge = (beyond_px >= -INSIDE_BLURS * disc.blur_px - PIXEL_PX) & (beyond_px <= outside_px)
    ring = beside[(beyond_px > outside_px + disc.blur_px) & (beyond_px <= outside_px + disc.blur_px + RING_PX)]
    light, noise = _level(ring, noise) if ring.size else (0.0, noise)
    left_over = float(np.mean((beside[edge] - light) ** 2)) - noise**2
    return float(np.sqrt(max(left_over, 0.0))) / disc.depth


def _level(ring: FloatArray, noise: float) -> tuple[float, float]:
    """Light beside a droplet, and its noise, where that is more than elsewhere: as where a light falls off."""
    light = float(np.median(ring))
    return light, max(noise, 1.4826 * float(np.median(np.abs(ring - light))))


def _around(shape: tuple[int, ...], disc: ToldDisc) -> tuple[tuple[slice, slice], FloatArray]:
    """The part of an image that a disc changes, and how far its pixels are from the centre."""
    reach_px = 1.5 * disc.radius_px + 4 * disc.blur_px + PIXEL_PX + RING_PX
    top, left = max(int(disc.row - reach_px), 0), max(int(disc.column - reach_px), 0)
    bottom, right = min(int(disc.row + reach_px) + 2, shape[0]), min(int(disc.column + reach_px) + 2, shape[1])
    down_px, along_px = np.arange(top, bottom)[:, None] - disc.row, np.arange(left, right)[None] - disc.column
    (a, b), (_, c) = disc.stretch
    return (slice(top, bottom), slice(left, right)), np.hypot(a * down_px + b * along_px, b * down_px + c * along_px)


def _darkness(disc: ToldDisc, distances_px: FloatArray) -> FloatArray:
    """Of a disc as deep as 1 in its middle."""
    far_px = np.arange(0.0, float(distances_px.max()) + _STEP_PX, _STEP_PX)
    dark = profile(far_px, disc.radius_px, max(disc.blur_px, 1e-3 * disc.radius_px))
    return np.asarray(np.interp(distances_px, far_px, dark / dark[0]))
