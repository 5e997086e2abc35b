"""Liquid that is no droplet, told from droplets by how discs explain it, and the pixels that look through it.

A ligament, a rim or a torn piece of a sheet is opaque, too; discs explain it only in a row, one touching the next in
space. Droplets touch in images, where they lie behind each other, but hardly ever in space: of 1400 droplets, 28 per
mm^3, three touch in one place or none, and never in a long row. Nothing is to be given but what "in a row" means.
"""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from processing.analysis.droplets.shadows.discs.opaque_discs import DiscOptics, Discs
from processing.analysis.droplets.sight_lattice import SightLattice
from processing.geometry import FloatArray

Mask = NDArray[np.bool_]
TOUCHING = 1.25
"""Discs touch where their centres are closer than so many sums of their radii: places are known less well than that."""
LEAST_DISCS, LEAST_LENGTH = 3, 2.4
"""So many discs that touch, over so many diameters of the largest, are no droplets."""
CLOSE, UNEXPLAINED = 1.0, 1.5
"""Two discs closer than so many sums of their radii, around both of which the residual is so many times the noise, are
a lump that is not round: droplets do not touch, or become one."""
WITHIN = 0.9
"""So are ``LEAST_DISCS`` that are closer than so many sums of their radii, however well they explain it: of 71,000
droplets of simulated shots, 14 to 56 per mm^3, nine are, some of which were placed so."""
BLUR_REACH_SIGMAS = 3.0
"""So far around a disc its shadow reaches."""
MASK_SHIFT = 4
"""Bits of a pixel to which masks are drawn."""


def touching_pairs(discs: Discs, touching: float = TOUCHING) -> NDArray[np.intp]:
    """Pairs (M, 2) of discs that touch in space: whose centres are closer than so many sums of their radii."""
    radii = discs.radii_voxel
    if len(discs) < 2:
        return np.empty((0, 2), np.intp)
    pairs = cKDTree(discs.positions_voxel).query_pairs(2 * touching * float(radii.max()), output_type="ndarray")
    one, other = pairs.T
    apart = np.linalg.norm(discs.positions_voxel[one] - discs.positions_voxel[other], axis=1)
    return np.asarray(pairs[apart < touching * (radii[one] + radii[other])], dtype=np.intp)


def liquid_objects(discs: Discs) -> NDArray[np.intp]:
    """For each disc (N,) the number of the object that it is a part of, from 0; -1 for droplets."""
    labels = _linked(len(discs), touching_pairs(discs))
    objects, number = np.full(len(discs), -1, np.intp), 0
    for label in np.flatnonzero(np.bincount(labels, minlength=1) >= LEAST_DISCS):
        members = np.flatnonzero(labels == label)
        if _relative_length(discs.where(labels == label)) >= LEAST_LENGTH:
            objects[members] = number
            number += 1
    return objects


def lumps(discs: Discs, residual: FloatArray) -> NDArray[np.intp]:
    """For each disc (N,) the number of the lump that it is a part of, from 0; -1 for droplets.

    Parameters
    ----------
    discs : Discs
        That are no liquid yet.
    residual : (N,) array
        Root mean square of what is left around each, over the noise.
    """
    pairs, near = touching_pairs(discs, CLOSE), touching_pairs(discs, WITHIN)
    heaps = _linked(len(discs), near)
    heaped = np.bincount(heaps, minlength=1)[heaps] >= LEAST_DISCS
    linked = [pairs[np.all(residual[pairs] > UNEXPLAINED, axis=1)], near[heaped[near[:, 0]]]]
    labels = _linked(len(discs), np.concatenate(linked))
    lump = np.bincount(labels, minlength=1)[labels] > 1
    numbers = np.full(len(discs), -1, np.intp)
    numbers[lump] = np.unique(labels[lump], return_inverse=True)[1]
    return numbers


def _linked(count: int, pairs: NDArray[np.intp]) -> NDArray[np.int32]:
    """Labels (count,) of what hangs together by pairs."""
    links = coo_matrix((np.ones(len(pairs)), tuple(pairs.T)), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int32)


def _relative_length(discs: Discs) -> float:
    """From end to end, in diameters of the largest disc."""
    radii = discs.radii_voxel
    between = np.linalg.norm(discs.positions_voxel[:, None] - discs.positions_voxel[None], axis=2)
    return float((between + radii[:, None] + radii[None]).max() / (2 * radii.max()))


def liquid_masks(
    liquid: Discs, lattice: SightLattice, optics: DiscOptics, shapes: Sequence[tuple[int, ...]]
) -> tuple[Mask, ...]:
    """Pixels (rows, columns) of each view that look through liquid, its blurred edge included.

    Parameters
    ----------
    liquid : Discs
        Those that explain it.
    lattice : SightLattice
        Of the views.
    optics : DiscOptics
        How they see.
    shapes : sequence of (rows, columns)
        Of the images.
    """
    centres_px = lattice.seen_px(liquid.positions_voxel) + optics.shifts_px[:, None]
    blurs_px = optics.blurs_px(liquid.positions_voxel[:, 2])
    reach_px = lattice.scales_px(liquid.positions_voxel) * liquid.radii_voxel + BLUR_REACH_SIGMAS * blurs_px
    pairs = touching_pairs(liquid)
    return tuple(
        _drawn(centres, reach, pairs, shape) for centres, reach, shape in zip(centres_px, reach_px, shapes, strict=True)
    )


def _drawn(
    centres_px: NDArray[np.float64], reach_px: NDArray[np.float64], pairs: NDArray[np.intp], shape: tuple[int, ...]
) -> Mask:
    """Discs, and between those that touch a line as wide as the narrower."""
    mask = np.zeros(shape, np.uint8)
    fine_px = np.rint(centres_px * 2**MASK_SHIFT).astype(int)
    for centre, reach in zip(fine_px.tolist(), np.rint(reach_px * 2**MASK_SHIFT).astype(int).tolist(), strict=True):
        cv2.circle(mask, centre, reach, 1, cv2.FILLED, shift=MASK_SHIFT)
    widths_px = np.maximum(1, 2 * reach_px[pairs].min(axis=1)).astype(int).tolist()
    for (one, other), width_px in zip(pairs.tolist(), widths_px, strict=True):
        cv2.line(mask, fine_px[one].tolist(), fine_px[other].tolist(), 1, width_px, shift=MASK_SHIFT)
    return mask > 0
