"""Grid assignment: which detected point is which node of a regular target. Pure geometry, by neighbours."""

import heapq
import math
from collections.abc import Callable
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from processing.geometry import FloatArray

Node = tuple[int, int]
IdArray = NDArray[np.int64]

TOLERANCE = 0.25
"""How far a point may lie from where its neighbours expect it, in lattice steps."""

MAX_DEVIATIONS = 8
"""How many medians a point may lie beside the smooth grid."""
MIN_DEVIATION_PX = 0.15
"""Points this close to the smooth grid are never dropped."""
MIN_EDGE_STRENGTH = 0.75
"""Outer corners of a board are at least this strong compared to the next line inside; T-junctions have 0.5."""
MIN_SMOOTH_POINTS = 150
"""Fewer points do not draw the grid finely enough to judge one of them; the fit of the camera does."""

_DIRECTIONS: tuple[tuple[int, int], ...] = ((0, 1), (0, -1), (1, 1), (1, -1))


@dataclass(frozen=True)
class Lattice:
    """Points that were assigned to nodes.

    Parameters
    ----------
    ids : (N, 2) array
        Column and row of each point.
    indices : (N,) array
        Which of the detected points it is.
    """

    ids: IdArray
    indices: IdArray

    def __len__(self) -> int:
        return len(self.ids)

    def with_ids(self, ids: IdArray) -> "Lattice":
        """The same points under other ids."""
        return Lattice(np.asarray(ids, dtype=np.int64), self.indices)

    def select(self, chosen: NDArray[np.bool_]) -> "Lattice":
        """Some of the points."""
        return Lattice(self.ids[chosen], self.indices[chosen])


def _everything_fits(_parent: int, _child: int) -> bool:
    return True


@dataclass
class _Growth:
    points_px: FloatArray
    fits: Callable[[int, int], bool]
    tree: cKDTree
    nodes: dict[Node, int] = field(default_factory=dict)
    taken: set[int] = field(default_factory=set)
    steps: dict[Node, FloatArray] = field(default_factory=dict)
    queue: list[tuple[float, Node, int, int, Node]] = field(default_factory=list)

    def accept(self, node: Node, index: int, steps_px: FloatArray) -> None:
        self.nodes[node] = index
        self.taken.add(index)
        self.steps[node] = steps_px
        self._offer(node)

    def _offer(self, node: Node) -> None:
        """Queue the points that lie where the lattice continues from a node."""
        ahead = [direction for direction in _DIRECTIONS if _neighbour(node, *direction) not in self.nodes]
        if not ahead:
            return
        here = self.nodes[node]
        steps_px = np.array([self._step_px(node, axis, sign) for axis, sign in ahead])
        nearest = self.tree.query(self.points_px[here] + steps_px)
        distances_px, found = (np.asarray(values).tolist() for values in nearest)
        for (axis, sign), step_px, distance_px, index in zip(ahead, steps_px, distances_px, found, strict=True):
            length_px = math.hypot(*step_px)
            if distance_px < TOLERANCE * length_px and self.fits(here, index):
                candidate = (distance_px / length_px, _neighbour(node, axis, sign), index, sign * (axis + 1), node)
                heapq.heappush(self.queue, candidate)

    def _step_px(self, node: Node, axis: int, sign: int) -> FloatArray:
        """The step that leads on from a node: the one from the point behind, where there is one."""
        behind = self.nodes.get(_neighbour(node, axis, -sign))
        if behind is None:
            return np.asarray(sign * self.steps[node][axis], dtype=np.float64)
        return np.asarray(self.points_px[self.nodes[node]] - self.points_px[behind], dtype=np.float64)

    def run(self) -> None:
        """Take the best-fitting candidate until none is left."""
        while self.queue:
            _, node, index, direction, parent = heapq.heappop(self.queue)
            if node in self.nodes or index in self.taken:
                continue
            axis, sign = abs(direction) - 1, 1 if direction > 0 else -1
            steps_px = self.steps[parent].copy()
            steps_px[axis] = sign * (self.points_px[index] - self.points_px[self.nodes[parent]])
            self.accept(node, index, steps_px)


def grow_lattice(
    points_px: FloatArray,
    start: int,
    steps_px: FloatArray,
    fits: Callable[[int, int], bool] = _everything_fits,
) -> Lattice:
    """Assign points to the nodes of a lattice, from one of them outwards, best fit first.

    Parameters
    ----------
    points_px : (N, 2) array
        Detected points.
    start : int
        Index of the point that becomes node (0, 0).
    steps_px : (2, 2) array
        Rows: step to the next column and to the next row, near the start.
    fits : callable
        Whether two points (indices) can be neighbours; rules out dust.

    Returns
    -------
    Lattice
        Nodes reached; at least the start.
    """
    growth = _Growth(points_px, fits, cKDTree(points_px))
    growth.accept((0, 0), start, np.asarray(steps_px, dtype=np.float64))
    growth.run()
    return Lattice(
        np.array(list(growth.nodes), dtype=np.int64), np.fromiter(growth.nodes.values(), np.int64, len(growth.nodes))
    )


def orient(lattice: Lattice, points_px: FloatArray, roll_deg: float = 0.0) -> Lattice:
    """Turn ids so that columns run to the right and rows downwards, as seen from the front of the target.

    In the image of a camera that is rolled about its axis, columns run to where such a camera sees the right.
    """
    columns_step_px, rows_step_px = _mean_steps(lattice, points_px)
    ids = lattice.ids
    if np.linalg.det(np.array([columns_step_px, rows_step_px])) < 0:
        ids, columns_step_px, rows_step_px = ids[:, ::-1], rows_step_px, columns_step_px
    right = np.array([np.cos(np.deg2rad(roll_deg)), -np.sin(np.deg2rad(roll_deg))])
    turns = max(range(4), key=lambda turn: float(_turned_step(columns_step_px, rows_step_px, turn) @ right))
    return lattice.with_ids(rotate_ids(ids, turns))


def shortest_step_px(lattice: Lattice, points_px: FloatArray) -> float:
    """Distance of neighbouring nodes along the tighter packed axis, in px."""
    return float(min(np.linalg.norm(step) for step in _mean_steps(lattice, points_px)))


def rotate_ids(ids: IdArray, quarter_turns: int) -> IdArray:
    """Ids of the same points when the axes of the lattice are turned by quarter turns (columns become rows)."""
    turn = np.linalg.matrix_power(np.array([[0, 1], [-1, 0]]), quarter_turns % 4)
    return np.asarray(ids @ turn.T, dtype=np.int64)


def on_smooth_grid(ids: IdArray, points_px: FloatArray) -> NDArray[np.bool_]:
    """Which points lie where a smooth image of the grid has them; dust on a corner shifts it.

    The smooth image is a homography times a cubic polynomial, fitted with outliers weighted down.
    """
    if len(ids) < MIN_SMOOTH_POINTS:
        return np.ones(len(ids), dtype=np.bool_)
    source = ids.astype(np.float64)
    homography, _ = cv2.findHomography(source, points_px, cv2.LMEDS)
    expected_px = cv2.perspectiveTransform(source.reshape(-1, 1, 2), homography).reshape(-1, 2)
    residual_px = points_px - expected_px
    x, y = ((source - source.mean(axis=0)) / np.maximum(np.ptp(source, axis=0), 1)).T
    design = np.stack([x**i * y**j for i in range(4) for j in range(4 - i)], axis=1)
    weights = np.ones(len(ids))
    for _ in range(10):
        solution, *_ = np.linalg.lstsq(design * weights[:, None], residual_px * weights[:, None], rcond=None)
        distance_px = np.linalg.norm(residual_px - design @ solution, axis=1)
        scale_px = max(float(np.median(distance_px)), 1e-6)
        weights = 1 / (1 + (distance_px / (3 * scale_px)) ** 2)
    return np.asarray(distance_px < max(MAX_DEVIATIONS * scale_px, MIN_DEVIATION_PX), dtype=np.bool_)


def trim_frame(lattice: Lattice, strength: FloatArray) -> Lattice:
    """Drop outer lines that are not part of a pattern: stray points, and the printed frame of a board.

    Where the squares of a checkerboard meet its frame, T-junctions look like corners of half the strength.

    Parameters
    ----------
    lattice : Lattice
        Grid, possibly larger than the pattern.
    strength : (N,) array
        How strong each of the detected points is.
    """
    frame = _frame_line(lattice, strength)
    while frame is not None:
        axis, line = frame
        lattice = lattice.select(lattice.ids[:, axis] != line)
        frame = _frame_line(lattice, strength)
    return lattice


def _frame_line(lattice: Lattice, strength: FloatArray) -> tuple[int, int] | None:
    """Axis and id of an outermost line that is sparse, or weak compared to the next one; None if all are fine."""
    for axis in (0, 1):
        lines, line_of_point = np.unique(lattice.ids[:, axis], return_inverse=True)
        if len(lines) < 2:
            continue
        counts = np.bincount(line_of_point)
        for edge, inner in ((0, 1), (len(lines) - 1, len(lines) - 2)):
            outer_strength, inner_strength = (
                float(np.median(strength[lattice.indices[line_of_point == line]])) for line in (edge, inner)
            )
            if 2 * counts[edge] < np.median(counts) or outer_strength < MIN_EDGE_STRENGTH * inner_strength:
                return axis, int(lines[edge])
    return None


def place_board(lattice: Lattice, columns: int, rows: int) -> Lattice | None:
    """Ids counted from the upper left corner of a board of known size; None where the grid has another size.

    A board turned by about 90 degrees is recognised by its shape.
    """
    for turns in (0, 1):
        ids = rotate_ids(lattice.ids, turns)
        ids = ids - ids.min(axis=0)
        if tuple(ids.max(axis=0) + 1) == (columns, rows):
            return lattice.with_ids(ids)
    return None


def _mean_steps(lattice: Lattice, points_px: FloatArray) -> tuple[FloatArray, FloatArray]:
    design = np.column_stack([lattice.ids, np.ones(len(lattice))])
    solution, *_ = np.linalg.lstsq(design, points_px[lattice.indices], rcond=None)
    return solution[0], solution[1]


def _turned_step(columns_step_px: FloatArray, rows_step_px: FloatArray, turn: int) -> FloatArray:
    """Direction in which column ids grow after so many quarter turns."""
    return (columns_step_px, rows_step_px, -columns_step_px, -rows_step_px)[turn]


def _neighbour(node: Node, axis: int, sign: int) -> Node:
    return (node[0] + sign, node[1]) if axis == 0 else (node[0], node[1] + sign)
