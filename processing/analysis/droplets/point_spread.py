"""What droplets look like in every view: a first guess from the images alone, and its refinement by the fit."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import uniform_filter

from processing.analysis.droplets.gaussian_blobs import BlobImages, BlobOptics, Blobs, Image
from processing.analysis.smooth_level import smooth_level
from processing.geometry import FloatArray
from processing.kernels import _native

STEP_PX = 0.01
"""Of numerical derivatives."""
LEAST_SIGMA_PX = 0.4
MOST_SIGMA_PX = (_native.MAX_BLOB_WINDOW_PX / 2 - 1) / _native.BLOB_REACH_SIGMAS - STEP_PX
ROUGH_PX = 41
"""What varies over more is no droplet."""
DARKEST, DARKEST_SIGMAS = 0.01, 2.326
"""Share of the pixels that are surely dark, and how far below its mean noise has as many."""
LEAST_CELL_PX, CELL_WIDTHS = 25, 20
"""The level is told by cells of so many pixels, or so many widths of a droplet, if these are more: it may follow glare,
and must not follow droplets."""
GUESSES = 3
"""Glare looks like wide droplets until the level is known, and that depends on how wide droplets are."""
MOST_CHANGE = 0.1
"""Of gain and widths in one refinement; of shifts in px."""


def first_optics(images: Sequence[Image]) -> BlobOptics:
    """Gains and widths from the autocorrelation of images whose noise is 1.

    Randomly placed equal blobs have a Gaussian one, sqrt(2) as wide; lag 0 holds the noise as well and is left out.
    The level is where the darkest hundredth of the pixels around would lie if they were noise.
    """
    levels, guesses = zip(*map(_first_guess, images), strict=True)
    gains, *widths_px = np.array(guesses).T
    return BlobOptics(gains / gains.mean(), np.column_stack(widths_px), np.zeros((len(images), 2)), levels)


def _first_guess(image: Image) -> tuple[Image, tuple[float, float, float]]:
    """Level, and gain and widths."""
    cell_px = LEAST_CELL_PX
    for _ in range(GUESSES):
        level = smooth_level(image, cell_px, DARKEST) + np.float32(DARKEST_SIGMAS)
        guess = _guess(image - level)
        cell_px = _cell_px(guess[1:])
    return level, guess


def _cell_px(widths_px: Sequence[float]) -> int:
    return max(LEAST_CELL_PX, round(CELL_WIDTHS * max(widths_px)))


def _guess(image: Image) -> tuple[float, float, float]:
    detail = image - uniform_filter(image, ROUGH_PX, mode="nearest")
    power = np.abs(np.fft.rfft2(detail, s=[2 * n for n in image.shape])) ** 2
    correlation = np.fft.irfft2(power)[:3, :3] / image.size
    along_u, along_v = _width(correlation[0, 1:]), _width(correlation[1:, 0])
    height = max(float(correlation[0, 1]), 1e-12) * np.exp(0.25 / along_u**2)
    return float(np.sqrt(height / (np.pi * along_u * along_v))), along_u, along_v


def _width(correlation: FloatArray) -> float:
    near, far = float(correlation[0]), float(correlation[1])
    if not near > far > 0:
        return LEAST_SIGMA_PX if near > 0 else 1.0
    return float(np.clip(np.sqrt(0.75 / np.log(near / far)), LEAST_SIGMA_PX, MOST_SIGMA_PX))


def refined_optics(shot: BlobImages, optics: BlobOptics, blobs: Blobs, *, shifts: bool) -> BlobOptics:
    """One Gauss-Newton step of gains, widths and shifts of all views, all blobs fixed; then the levels.

    What the shifts of all views have in common with a motion of the volume is taken out: the calibration says better
    where the volume is. A level is the median of what is left around.
    """
    residuals = shot.residuals(optics, blobs)
    steps = _steps(shot, optics, blobs, residuals, shifts)
    gains = optics.gains * (1 + np.clip(steps[:, 0], -MOST_CHANGE, MOST_CHANGE))
    widths = optics.sigmas_px * (1 + np.clip(steps[:, 1:3] / optics.sigmas_px, -MOST_CHANGE, MOST_CHANGE))
    moved = optics.shifts_px + np.clip(steps[:, 3:], -MOST_CHANGE, MOST_CHANGE)
    return BlobOptics(
        gains / gains.mean(),
        np.clip(widths, LEAST_SIGMA_PX, MOST_SIGMA_PX),
        without_motion(moved, shot.lattice.motion_px),
        tuple(
            level + smooth_level(residual, _cell_px(widths_px))
            for level, residual, widths_px in zip(optics.levels, residuals, optics.sigmas_px.tolist(), strict=True)
        ),
    )


def _steps(shot: BlobImages, optics: BlobOptics, blobs: Blobs, residuals: Sequence[Image], shifts: bool) -> FloatArray:
    """Steps (K, 5) of relative gain, two widths and two shifts."""
    drawn = shot.drawn(optics, blobs)
    changed = [shot.drawn(other, blobs) for other in _varied(optics, shifts)]
    steps = np.zeros((len(drawn), 5))
    for view, (image, residual) in enumerate(zip(drawn, residuals, strict=True)):
        slopes = [image, *((other[view] - image) / STEP_PX for other in changed)]
        jacobian = np.array([slope.ravel() for slope in slopes])
        normal = (jacobian @ jacobian.T).astype(np.float64)
        steps[view, : len(slopes)] = np.linalg.lstsq(normal, jacobian @ residual.ravel(), rcond=1e-6)[0]
    return steps


def _varied(optics: BlobOptics, shifts: bool) -> list[BlobOptics]:
    along_u, along_v = np.array([STEP_PX, 0]), np.array([0, STEP_PX])
    widths = [replace(optics, sigmas_px=optics.sigmas_px + step) for step in (along_u, along_v)]
    if not shifts:
        return widths
    return widths + [replace(optics, shifts_px=optics.shifts_px + step) for step in (along_u, along_v)]


def without_motion(shifts_px: FloatArray, motion_px: FloatArray) -> FloatArray:
    """Shifts (K, 2) of the views without what a motion of the whole volume explains: ``SightLattice.motion_px``."""
    common = np.linalg.lstsq(motion_px, shifts_px.ravel(), rcond=None)[0]
    return shifts_px - (motion_px @ common).reshape(-1, 2)
