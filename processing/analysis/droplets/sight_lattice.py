"""SightLattice: where every view sees any point of a grid, as quickly as a fit needs it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from processing.geometry import FloatArray, ViewMapping
from processing.kernels import _native
from processing.reconstruction.errors import RoughMapping
from processing.reconstruction.planning.bending import bend_px
from processing.reconstruction.planning.node_view import project_lattice
from processing.volume import VoxelGrid

MAX_DEVIATION_PX = 0.01
"""What the lattice may add to the position of a droplet, which is measured to 0.02 px."""
HOPELESS_PX = 100.0
"""A mapping that bends by so much between the nodes farthest apart bends by more than the limit between the nearest
ones, too: a grid that reaches far beyond what was calibrated is not sampled in vain."""
APART_DEG = 9.0
"""Views along lines that are nearer than that, or that look at each other, tell nearly the same: of 120 droplets, four
views 5 degrees apart make 126, 8 degrees 122, 10 degrees no more than there are."""


@dataclass(frozen=True, eq=False)
class SightLattice:
    """The calibrated mappings at every ``spacing``-th voxel, linear in between.

    Parameters
    ----------
    nodes_px : (views, nodes_z, nodes_y, nodes_x, 2) array
        Column and row in px.
    spacing : int
        Voxels from node to node.
    deviation_px : float
        Largest distance to the mappings between the nodes.
    """

    nodes_px: FloatArray
    spacing: int
    deviation_px: float

    @property
    def motion_px(self) -> FloatArray:
        """What a motion of the whole volume by a voxel along x, y, z moves on average in the images: (2 views, 3)."""
        # Steps add up to what lies between the two ends.
        spans = [
            (last - first).mean(axis=(1, 2)) / (self.nodes_px.shape[axis] - 1)
            for axis in (3, 2, 1)
            for first, last in [(self.nodes_px.take(end, axis) for end in (0, -1))]
        ]
        return np.stack(spans, axis=-1).reshape(-1, 3) / self.spacing

    @property
    def directions(self) -> int:
        """Along how many lines the views look that are apart; of two that look at each other one counts."""
        lines: list[FloatArray] = []
        for right, down in self.motion_px.reshape(-1, 2, 3):
            line = np.cross(right, down) / np.linalg.norm(np.cross(right, down))
            if all(abs(line @ other) < np.cos(np.deg2rad(APART_DEG)) for other in lines):
                lines.append(line)
        return len(lines)

    @property
    def pixels_per_voxel(self) -> float:
        """How wide a voxel is seen at most, mean over the views."""
        return float(np.linalg.norm(self.motion_px.reshape(-1, 2, 3), axis=1).max(axis=1).mean())

    def within(self, origins_px: FloatArray) -> "SightLattice":
        """The same in images that begin at ``origins_px`` (views, 2), column and row."""
        return replace(self, nodes_px=np.ascontiguousarray(self.nodes_px - origins_px[:, None, None, None]))

    def seen_px(self, positions_voxel: FloatArray) -> FloatArray:
        """Image points (views, N, 2) of positions (N, 3) x, y, z of the grid."""
        level, _, corners = self._cells(positions_voxel)
        return np.asarray(np.einsum("kzyxnc,zn,yn,xn->knc", corners, *(level[:, :, axis] for axis in (0, 1, 2))))

    def slopes_px(self, positions_voxel: FloatArray) -> FloatArray:
        """How image points move with positions (N, 3) x, y, z of the grid: (views, N, 2, 3) px per voxel."""
        level, slope, corners = self._cells(positions_voxel)
        weights = [np.where(np.arange(3) == axis, slope, level) for axis in (2, 1, 0)]
        return np.stack(
            [np.einsum("kzyxnc,zn,yn,xn->knc", corners, *(ends[:, :, axis] for axis in (0, 1, 2))) for ends in weights],
            axis=-1,
        )

    def scales_px(self, positions_voxel: FloatArray) -> FloatArray:
        """Pixels per voxel across the line of sight (views, N): by the area that a square across it is seen as."""
        slopes = self.slopes_px(positions_voxel)
        return np.asarray(np.linalg.det(slopes @ np.swapaxes(slopes, -1, -2)) ** 0.25)

    def _cells(self, positions_voxel: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Weights (2, N, zyx) of the ends of the cells for values and for slopes, and the corners of the cells."""
        nodes = np.asarray(positions_voxel)[:, ::-1] / self.spacing
        cells = np.clip(np.floor(nodes), 0, np.array(self.nodes_px.shape[1:4]) - 2).astype(np.intp)
        z, y, x = cells.T[:, None, :] + np.arange(2)[:, None]
        corners = self.nodes_px[:, z[:, None, None], y[None, :, None], x[None, None, :]]
        level = np.stack([1 - (nodes - cells), nodes - cells])
        slope = np.broadcast_to(np.array([-1.0, 1.0])[:, None, None] / self.spacing, level.shape)
        return level, slope, corners


def sight_lattice(mappings: Sequence[ViewMapping], grid: VoxelGrid) -> SightLattice:
    """Sample mappings as densely as it takes to know them everywhere to ``MAX_DEVIATION_PX``.

    Raises
    ------
    RoughMapping
        One is too rough even for nodes two voxels apart.
    """
    deviation_px = np.inf
    for spacing in _native.NODE_SPACINGS:
        nodes_px = [project_lattice(mapping, grid, spacing) for mapping in mappings]
        deviation_px = max(
            bend_px(nodes, partial(project_lattice, mapping, grid, spacing))
            for nodes, mapping in zip(nodes_px, mappings, strict=True)
        )
        if deviation_px <= MAX_DEVIATION_PX:
            return SightLattice(np.ascontiguousarray(nodes_px, dtype=np.float64), spacing, deviation_px)
        if deviation_px > HOPELESS_PX:
            break
    raise RoughMapping(
        f"a mapping bends by {deviation_px:.3g} px within {spacing} voxels, limit "
        f"{MAX_DEVIATION_PX} px: droplets cannot be measured; does the grid reach beyond what was calibrated?"
    )
