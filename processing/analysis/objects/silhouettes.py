"""How long an object is in each direction, from its silhouettes: the hull is longer than what made it, they are not.

Seen from directions within +-45 degrees, the hull of a ball is 1.4 times longer along z, and that of a thread across
the middle view is a rhomb as long along z as the thread. The silhouette of an ellipsoid of the tensor S (3, 3) is an
ellipse of the tensor J S J' (2, 2), with J (2, 3) the sight of a view. So S is what fits all silhouettes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.geometry import FloatArray, ViewMapping
from processing.volume import VoxelGrid

LEAST_VIEWS = 3
"""Two silhouettes fit many shapes."""
_PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
_CELL_VARIANCE = 1 / 12
"""Of a cell of one voxel's width about its centre."""


def sights(mappings: Sequence[ViewMapping], grid: VoxelGrid) -> FloatArray:
    """How views see motions in the middle of a grid, in units of their own scale: (views, 2, 3)."""
    middle_mm = np.array([axis_mm[[0, -1]].mean() for axis_mm in (grid.x_mm, grid.y_mm, grid.z_mm)])
    step_mm = grid.pitch_mm
    ends_mm = middle_mm + step_mm * np.vstack([np.eye(3), -np.eye(3)])
    seen_px = np.stack([mapping.project(ends_mm) for mapping in mappings])
    slopes = np.swapaxes(seen_px[:, :3] - seen_px[:, 3:], 1, 2) / (2 * step_mm)
    scales = np.linalg.det(slopes @ np.swapaxes(slopes, 1, 2)) ** 0.25
    return np.asarray(slopes / scales[:, None, None], dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Shapes:
    """Shapes of N objects.

    Parameters
    ----------
    tensors_mm2 : (N, 3, 3) array
        Covariance x, y, z of the ellipsoid, or rod, whose silhouettes fit.
    misfit_mm2 : (N,) array
        Root mean square of what silhouettes leave of its elements.
    filling : (N,) array
        Of the view where it is least: area of the silhouette over that of the ellipse of the same covariance; 1 for an
        ellipse, 0.95 for a strip, less for what is bent, has holes, or is several.
    own_share : (N,) array
        Of the view where it is third largest: share of the silhouette that no larger object explains. Lines of sight
        through true objects meet in ghosts: what they show is explained already.
    """

    tensors_mm2: FloatArray
    misfit_mm2: FloatArray
    filling: FloatArray
    own_share: FloatArray


def shapes_of(points_mm: FloatArray, objects: NDArray[np.int32], sight: FloatArray, pitch_mm: float) -> Shapes:
    """Shapes of objects that are made of voxels.

    Parameters
    ----------
    points_mm : (M, 3) array
        Centres of voxels.
    objects : (M,) int array
        Number of the object of each, 0 to N - 1.
    sight : (views, 2, 3) array
        Of ``sights``.
    pitch_mm : float
        Width of a voxel.
    """
    sizes = np.bincount(objects)
    rank = np.argsort(np.argsort(-sizes, kind="stable"))
    outlines = [_covered(points_mm @ view.T / pitch_mm, objects) for view in sight]
    tensors, fillings = zip(*(_moments(outline, len(sizes)) for outline in outlines), strict=True)
    seen = np.concatenate([np.stack([t[:, 0, 0], t[:, 0, 1], t[:, 1, 1]], axis=1) for t in tensors], axis=1)
    design = np.concatenate([_rows(view) for view in sight])
    elements = seen @ np.linalg.pinv(design).T
    misfit = np.sqrt(np.mean((elements @ design.T - seen) ** 2, axis=1))
    tensor = np.empty((len(sizes), 3, 3))
    for (one, other), values in zip(_PAIRS, elements.T, strict=True):
        tensor[:, one, other] = tensor[:, other, one] = values
    own = np.sort([_own_share(outline, rank) for outline in outlines], axis=0)[-min(LEAST_VIEWS, len(sight))]
    return Shapes(tensor * pitch_mm**2, misfit * pitch_mm**2, np.min(fillings, axis=0), own)


@dataclass(frozen=True, eq=False)
class _Outline:
    """Cells (M,) that objects cover in a view: whose each is, and where."""

    owner: NDArray[np.int64]
    column: NDArray[np.int64]
    row: NDArray[np.int64]


def _rows(view: FloatArray) -> FloatArray:
    """What the elements of S add to the elements uu, uv, vv of a silhouette: (3, 6)."""
    return np.array(
        [
            [view[i, a] * view[j, b] + (view[i, b] * view[j, a] if a != b else 0) for a, b in _PAIRS]
            for i, j in ((0, 0), (0, 1), (1, 1))
        ]
    )


def _covered(seen: FloatArray, objects: NDArray[np.int32]) -> _Outline:
    cells = np.rint(seen).astype(np.int64)
    cells -= cells.min(axis=0)
    wide = cells.max(axis=0) + 1
    flat = np.unique((objects * wide[0] + cells[:, 0]) * wide[1] + cells[:, 1])
    return _Outline(flat // (wide[0] * wide[1]), flat // wide[1] % wide[0], flat % wide[1])


def _moments(outline: _Outline, count: int) -> tuple[FloatArray, FloatArray]:
    """Covariance (N, 2, 2) of the cells that each object covers, and how well it fills the ellipse of that."""
    owner = outline.owner
    area = np.bincount(owner, minlength=count).astype(np.float64)
    middle = [np.bincount(owner, axis, count) / area for axis in (outline.column, outline.row)]
    u, v = outline.column - middle[0][owner], outline.row - middle[1][owner]
    uu, uv, vv = (np.bincount(owner, product, count) / area for product in (u * u, u * v, v * v))
    tensor = np.stack([uu + _CELL_VARIANCE, uv, uv, vv + _CELL_VARIANCE], axis=1).reshape(count, 2, 2)
    return tensor, area / (4 * np.pi * np.sqrt(np.linalg.det(tensor)))


def _own_share(outline: _Outline, rank: NDArray[np.intp]) -> FloatArray:
    """Share of the cells of each object that no larger one covers, (N,)."""
    owner, first = outline.owner, np.full((outline.column.max() + 1, outline.row.max() + 1), len(rank))
    np.minimum.at(first, (outline.column, outline.row), rank[owner])
    own = first[outline.column, outline.row] == rank[owner]
    return np.asarray(np.bincount(owner, own, len(rank)) / np.bincount(owner, minlength=len(rank)), dtype=np.float64)
