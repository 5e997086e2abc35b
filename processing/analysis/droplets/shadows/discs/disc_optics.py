"""How the views see discs: a first guess of the blur from the images alone, and its refinement by the fit."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from processing.analysis.droplets.gaussian_blobs import Image
from processing.analysis.droplets.point_spread import without_motion
from processing.analysis.droplets.shadows.discs.opaque_discs import DiscImages, DiscOptics, Discs
from processing.geometry import FloatArray

STEEPEST = 0.9995
"""Quantile of the slopes of an image that edges of large shadows have."""
LEAST_BLUR_PX, MOST_BLUR_PX = 0.4, 4.0
LEAST_SLOPE = 1e-3
"""Of an image, where nothing is seen."""
MOST_CHANGE = 0.15
"""Of the blur in one refinement, relative."""
MOST_SHIFT_PX = 0.1
STEP_PX2 = 0.01
"""Of numerical derivatives."""
FOCUS_PRIOR = 0.3
"""Of the blur squared: how far its change with depth may lie from none before images say so."""


def first_disc_optics(images: Sequence[Image]) -> DiscOptics:
    """Blur by the steepest edges, one for all depths; level by the median of what is not in shadow."""
    variances = np.zeros((len(images), 3))
    variances[:, 0] = [edge_blur_px(slopes_of(image)) ** 2 for image in images]
    levels = np.array([np.median(image[image > 0.9 * np.median(image)]) for image in images])
    return DiscOptics(variances, np.zeros((len(images), 2)), levels)


def slopes_of(image: Image) -> Image:
    """How fast an image changes, per pixel, in the direction in which it changes most."""
    along_v, along_u = np.gradient(image)
    return np.asarray(np.hypot(along_u, along_v), dtype=np.float32)


def edge_blur_px(slopes: Image) -> float:
    """Blur by the steepest slopes: that of a large disc is ``1 / (sqrt(2 pi) s)``; differences widen it by 1/3 px^2."""
    slope = max(float(np.quantile(slopes, STEEPEST)), LEAST_SLOPE)
    return float(np.clip(np.sqrt(max(0.1592 / slope**2 - 1 / 3, 0)), LEAST_BLUR_PX, MOST_BLUR_PX))


def refined_disc_optics(seen: DiscImages, optics: DiscOptics, discs: Discs, drawn: Sequence[Image]) -> DiscOptics:
    """One Gauss-Newton step of level, shift and blur of all views, all discs fixed.

    Parameters
    ----------
    seen : DiscImages
        Images over their levels.
    optics, discs : DiscOptics, Discs
        Where to begin.
    drawn : sequence of (rows, columns) float32 arrays
        What these discs let through, as one product.
    """
    middle, half = _depth_range(seen)
    powers = _powers(middle, half)
    changed = [
        seen.drawn(replace(optics, variances_px2=optics.variances_px2 + STEP_PX2 * power), discs).transmissions
        for power in powers
    ]
    variances, shifts, levels = optics.variances_px2.copy(), optics.shifts_px.copy(), optics.levels.copy()
    for view, image in enumerate(drawn):
        along_v, along_u = np.gradient(image)
        slopes = [image, -along_u, -along_v, *((other[view] - image) / STEP_PX2 for other in changed)]
        prior = np.zeros(len(slopes))
        prior[4:] = 1 / (FOCUS_PRIOR * variances[view, 0]) ** 2
        step = _step(np.array(slopes), seen, view, image, prior)
        levels[view] *= 1 + np.clip(step[0], -0.05, 0.05)
        shifts[view] += np.clip(step[1:3], -MOST_SHIFT_PX, MOST_SHIFT_PX)
        most = 2 * MOST_CHANGE * optics.blurs_px(middle)[view] ** 2
        variances[view] += sum(
            np.clip(value, -most, most) * power for value, power in zip(step[3:], powers, strict=True)
        )
    return replace(
        optics,
        variances_px2=held_variances(variances, middle),
        shifts_px=without_motion(shifts, seen.lattice.motion_px),
        levels=levels,
    )


def _step(slopes: FloatArray, seen: DiscImages, view: int, drawn: Image, prior: FloatArray) -> FloatArray:
    """By slopes (N, rows, columns). Rows are summed one by one: threads of a BLAS would wait for each other."""
    weighted = slopes * seen.weights[view]
    normal = np.einsum("irc,jrc->rij", weighted, slopes).sum(axis=0, dtype=np.float64) + np.diag(prior)
    right = np.einsum("irc,rc->ri", weighted, seen.images[view] - drawn).sum(axis=0, dtype=np.float64)
    return np.asarray(np.linalg.lstsq(normal, right, rcond=1e-9)[0])


def _depth_range(seen: DiscImages) -> tuple[float, float]:
    half = 0.5 * (seen.lattice.nodes_px.shape[1] - 1) * seen.lattice.spacing
    return half, half


def _powers(middle: float, half: float) -> FloatArray:
    """Polynomials 1, t and t^2 of the relative depth ``t = (z - middle) / half``, as coefficients of z."""
    return np.array(
        [[1, 0, 0], [-middle / half, 1 / half, 0], [(middle / half) ** 2, -2 * middle / half**2, 1 / half**2]]
    )


def held_variances(variances: FloatArray, middle: float) -> FloatArray:
    """Blurs (K, 3) that are neither sharper nor wider than any lens within a depth of ``2 middle``.

    No view is sharper out of focus than in it: where a blur would be, it is the same at all depths.
    """
    held = variances.copy()
    flat = held[:, 2] <= 0
    held[flat] = np.column_stack([held[flat] @ [1.0, middle, middle**2], np.zeros((np.count_nonzero(flat), 2))])
    vertex = np.where(flat, middle, -held[:, 1] / np.where(flat, 1, 2 * held[:, 2]))
    sharpest = np.clip(vertex, 0, 2 * middle)
    least = held[:, 0] + held[:, 1] * sharpest + held[:, 2] * sharpest**2
    held[:, 0] += np.clip(least, LEAST_BLUR_PX**2, MOST_BLUR_PX**2) - least
    return held
