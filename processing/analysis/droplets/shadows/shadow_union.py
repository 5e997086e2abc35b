"""What the product of shadows gets wrong: light sees the union of discs, blurred, and not each of them once more."""

from dataclasses import replace

import cv2
import numpy as np

from processing.analysis.droplets.gaussian_blobs import Image
from processing.analysis.droplets.shadows.discs.disc_profiles import OPACITY
from processing.analysis.droplets.shadows.discs.opaque_discs import DiscImages, DiscOptics, Discs
from processing.geometry import FloatArray
from processing.kernels import _native

BLUR_REACH_SIGMAS = 4.0


def union_defects(seen: DiscImages, optics: DiscOptics, discs: Discs) -> tuple[Image, ...]:
    """Transmission of the union of discs less the product of those of each, both with one blur per view.

    In incoherent light: where discs do not overlap there is nothing to correct, whatever the light; where they do,
    fringes are taken to multiply.
    """
    blurs_px = optics.blurs_px(discs.positions_voxel[:, 2].mean() if len(discs) else 0.0)
    one_blur = np.zeros_like(optics.variances_px2)
    one_blur[:, 0] = blurs_px**2
    incoherent = replace(optics, variances_px2=one_blur, condenser_ratio=None)
    product = seen.drawn(incoherent, discs).transmissions
    centres_px = seen.lattice.seen_px(discs.positions_voxel) + optics.shifts_px[:, None]
    radii_px = seen.lattice.scales_px(discs.positions_voxel) * discs.radii_voxel
    return tuple(
        united(centres, radii, float(blur_px), image.shape) - image
        for centres, radii, blur_px, image in zip(centres_px, radii_px, blurs_px, product, strict=True)
    )


def united(centres_px: FloatArray, radii_px: FloatArray, blur_px: float, shape: tuple[int, ...]) -> Image:
    """Transmission (rows, columns) of the union of discs under a Gaussian blur.

    Parameters
    ----------
    centres_px, radii_px : (N, 2), (N,) arrays
        Column and row of the discs, and their radii.
    blur_px : float
        Its standard deviation.
    shape : tuple of int
        Rows and columns of the image.
    """
    cells = _native.COVERAGE_CELLS
    covered = np.empty((shape[0] * cells, shape[1] * cells), np.float32)
    _native.cover(np.ascontiguousarray(centres_px), np.ascontiguousarray(radii_px), covered)
    sigma = float(np.sqrt((blur_px * cells) ** 2 - 1 / 12))  # a cell is a blur too
    width = 2 * int(np.ceil(BLUR_REACH_SIGMAS * sigma)) + 1
    blurred = cv2.GaussianBlur(covered, (width, width), sigma, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(1 - np.float32(OPACITY) * blurred[::cells, ::cells], dtype=np.float32)
