"""How far a mapping strays from what is linear between its nodes."""

from collections.abc import Callable, Sequence
from itertools import product

import numpy as np

from processing.geometry import FloatArray

PointsAt = Callable[[Sequence[float]], FloatArray]


def bend_px(nodes_px: FloatArray, points_at: PointsAt) -> float:
    """Largest distance in px of a mapping to linear interpolation between its nodes.

    It is found in the middle of an edge, a face or a cell, depending on which of the curvatures along the axes add and
    which cancel: exactly so for a mapping of second order. In the middle of the cells alone, saddles pass for straight.

    Parameters
    ----------
    nodes_px : (..., 2) array
        Image points of a lattice of any number of axes.
    points_at : callable
        Given an offset per axis, in spacings of the lattice, image points of all nodes moved by it.
    """
    offsets = product((0.0, 0.5), repeat=nodes_px.ndim - 1)
    return max(_distance_px(nodes_px, offset, points_at(offset)) for offset in offsets if any(offset))


def _distance_px(nodes_px: FloatArray, offset: Sequence[float], exact_px: FloatArray) -> float:
    middle_px = nodes_px
    for axis, along in enumerate(offset):
        if along:
            middle_px = 0.5 * (np.delete(middle_px, -1, axis) + np.delete(middle_px, 0, axis))
    inside = tuple(slice(n) for n in middle_px.shape)
    return float(np.linalg.norm(middle_px - exact_px[inside], axis=-1).max())
