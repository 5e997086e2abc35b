"""Calibration targets: what they look like, and their points in an image as nodes of a grid.

Ids (column, row) count from the target's origin node, which lies at x = y = 0: the marked dot, the node
nearest to ``origin_px``, or, where a whole board of known size is seen, its middle. Columns run along +x
(to the right in the image of an upright camera), rows along +y (downwards; the target may say that its y points up).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from processing.calibration.errors import OriginUnknown, TargetNotFound
from processing.calibration.target.checkerboard import (
    COARSE_SMOOTHINGS_PX,
    SMOOTHINGS_PX,
    corner_lattices,
    find_saddles,
    refine_corners,
)
from processing.calibration.target.dots import assign_dots, dot_signal, find_dots, marked_dot
from processing.calibration.target.lattice import (
    Lattice,
    on_smooth_grid,
    orient,
    place_board,
    shortest_step_px,
    trim_frame,
)
from processing.geometry import FloatArray

MIN_POINTS = 9
"""Fewer points than this are dust that happens to lie in rows."""


class Target(BaseModel):
    """A flat target with a regular pattern.

    Board sizes count inner corners (checkerboard) or dots. A dot target without ``columns`` and
    ``rows`` is larger than the image; it needs a marked origin or ``origin_px``.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    kind: Annotated[Literal["checkerboard", "dots"], Field(description="what its points are")]
    columns: Annotated[int, Field(ge=2, le=1000, description="inner corners or dots along x")] | None = None
    rows: Annotated[int, Field(ge=2, le=1000, description="inner corners or dots along y")] | None = None
    pitch_mm: Annotated[float, Field(gt=0, description="distance of neighbouring points")]
    y_axis: Annotated[
        Literal["down", "up"],
        Field(description="where y grows in the image; up with z away from the cameras is left-handed"),
    ] = "down"

    @model_validator(mode="after")
    def _has_both_or_none(self) -> "Target":
        if (self.columns is None) != (self.rows is None):
            raise ValueError("columns and rows belong together: give both or none")
        if self.kind == "checkerboard" and self.columns is None:
            raise ValueError("a checkerboard needs columns and rows, the number of its inner corners")
        return self

    def points_mm(self, ids: NDArray[np.int64]) -> FloatArray:
        """Positions (N, 2) on the target, x and y in mm, of nodes (N, 2)."""
        y_sign = -1 if self.y_axis == "up" else 1
        return np.asarray(ids, dtype=np.float64) * (self.pitch_mm, y_sign * self.pitch_mm)

    def board_ids(self) -> NDArray[np.int64]:
        """Nodes (N, 2) of a board of known size, row by row, counted from the node in its middle; else none."""
        columns, rows = self.columns or 0, self.rows or 0
        row, column = np.divmod(np.arange(columns * rows), max(columns, 1))
        return np.column_stack([column - (columns - 1) // 2, row - (rows - 1) // 2])


@dataclass(frozen=True, eq=False)
class TargetPoints:
    """Points of a target in one image.

    Parameters
    ----------
    ids : (N, 2) array
        Column and row, counted from the origin of the target.
    image_px : (N, 2) array
        Sub-pixel positions (u, v).
    """

    ids: NDArray[np.int64]
    image_px: FloatArray

    def __len__(self) -> int:
        return len(self.ids)


def detect_target(
    image: NDArray[np.generic],
    target: Target,
    origin_px: tuple[float, float] | None = None,
    roll_deg: float = 0.0,
) -> TargetPoints:
    """Find the points of a target and assign them to its grid.

    Parameters
    ----------
    image : (rows, columns) array
        Grey values of any type.
    target : Target
        What to look for.
    origin_px : tuple[float, float], optional
        Where the target's origin is seen, roughly (u, v). Not needed where a marker or the shape of
        the board tells; a marker wins.
    roll_deg : float
        How the camera is turned about its axis, to the nearest quarter: 180 where it hangs upside down.

    Returns
    -------
    TargetPoints
        Sorted by row, then column.

    Raises
    ------
    TargetNotFound
        There are too few points, or more than the board has; OriginUnknown where nothing tells which of them is the
        origin.
    """
    pixels = np.ascontiguousarray(image, dtype=np.float32)
    if target.kind == "checkerboard":
        grid, points_px = _find_corners(pixels, target, origin_px, roll_deg)
    else:
        grid, points_px = _find_dots(pixels, target, origin_px, roll_deg)
    ids, image_px = grid.ids, points_px[grid.indices]
    smooth = on_smooth_grid(ids, image_px)
    order = np.flatnonzero(smooth)[np.lexsort((ids[smooth, 0], ids[smooth, 1]))]
    return TargetPoints(ids[order], image_px[order])


def _find_corners(
    pixels: NDArray[np.float32], target: Target, origin_px: tuple[float, float] | None, roll_deg: float
) -> tuple[Lattice, FloatArray]:
    """The grid that fits the board, refined; the failure that came closest where none does."""
    failure, grown = TargetNotFound("checkerboard: no corners in a grid"), 0
    for board, points_px in _candidate_boards(pixels, roll_deg):
        if len(board) < max(MIN_POINTS, grown // 2):
            continue
        try:
            grid = _with_origin(board, points_px, target, None, origin_px)
        except TargetNotFound as error:
            grown, failure = max((grown, failure), (len(board), error), key=lambda attempt: attempt[0])
            continue
        points_px = points_px.copy()
        spacing_px = shortest_step_px(grid, points_px)
        points_px[grid.indices], converged = refine_corners(pixels, points_px[grid.indices], spacing_px)
        return grid.select(converged), points_px
    raise failure


def _candidate_boards(pixels: NDArray[np.float32], roll_deg: float) -> Iterator[tuple[Lattice, FloatArray]]:
    """Grids of corners and the corners; several scales and starts, as noise and dust can mislead one."""
    seen = False
    for smoothing_px in (*SMOOTHINGS_PX, *COARSE_SMOOTHINGS_PX):
        if seen and smoothing_px in COARSE_SMOOTHINGS_PX:
            return
        saddles = find_saddles(pixels, smoothing_px)
        for lattice in corner_lattices(saddles):
            if len(lattice) >= MIN_POINTS:
                seen = True
                yield trim_frame(orient(lattice, saddles.points_px, roll_deg), saddles.strength), saddles.points_px


def _find_dots(
    pixels: NDArray[np.float32], target: Target, origin_px: tuple[float, float] | None, roll_deg: float
) -> tuple[Lattice, FloatArray]:
    signal = dot_signal(pixels)
    points_px = find_dots(pixels, signal)
    lattice = assign_dots(points_px)
    if len(lattice) < MIN_POINTS:
        raise TargetNotFound(f"dots: {len(lattice)} points lie in a grid, at least {MIN_POINTS} are needed")
    found = marked_dot(signal, points_px[lattice.indices])
    marked = None if found is None else int(lattice.indices[found])
    return _with_origin(orient(lattice, points_px, roll_deg), points_px, target, marked, origin_px), points_px


def _with_origin(
    lattice: Lattice,
    points_px: FloatArray,
    target: Target,
    marked: int | None,
    origin_px: tuple[float, float] | None,
) -> Lattice:
    """Ids counted from the origin: a marker, a hint, or the middle of a board of known size."""
    if marked is None and origin_px is not None:
        marked = int(lattice.indices[_nearest(points_px[lattice.indices], origin_px, lattice, points_px)])
    if marked is not None:
        return _within_board(lattice.with_ids(lattice.ids - lattice.ids[lattice.indices == marked]), target)
    if target.columns is None or target.rows is None:
        raise OriginUnknown("dots: no dot carries a marker; say where the origin is seen (origin_px)")
    board = place_board(lattice, target.columns, target.rows)
    if board is None:
        raise OriginUnknown(_misfit(target, *_extent(lattice)))
    return board.with_ids(board.ids - ((target.columns - 1) // 2, (target.rows - 1) // 2))


def _within_board(lattice: Lattice, target: Target) -> Lattice:
    """Points that a board of the stated size can have: of a larger grid, sparse outer lines are stray points."""
    if target.columns is None or not _is_larger(target, *_extent(lattice)):
        return lattice
    even_strength = np.ones(int(lattice.indices.max()) + 1)
    trimmed = trim_frame(lattice, even_strength)
    if _is_larger(target, *_extent(trimmed)):
        raise TargetNotFound(_misfit(target, *_extent(trimmed)))
    return trimmed


def _extent(lattice: Lattice) -> tuple[int, int]:
    """Columns and rows that a grid spans."""
    columns, rows = (int(extent) + 1 for extent in np.ptp(lattice.ids, axis=0))
    return columns, rows


def _is_larger(target: Target, columns: int, rows: int) -> bool:
    """Whether a grid of so many points is larger than the board, upright or turned."""
    board = (target.columns or 0, target.rows or 0)
    return max(columns, rows) > max(board) or min(columns, rows) > min(board)


def _misfit(target: Target, columns: int, rows: int) -> str:
    """Why a grid of so many points seen is not the board, and what to do."""
    board = (target.columns or 0, target.rows or 0)
    text = (
        f"{target.kind}: a grid of {columns} x {rows} points is seen, not the whole board of {board[0]} x {board[1]}; "
    )
    if _is_larger(target, columns, rows):
        return text + "it is larger: are columns and rows right?"
    if target.kind == "checkerboard" and sorted((columns + 1, rows + 1)) == sorted(board):
        return text + "columns and rows count inner corners, not squares; or say where its origin is seen (origin_px)"
    return text + "say where its origin is seen (origin_px)"


def _nearest(candidates_px: FloatArray, origin_px: tuple[float, float], lattice: Lattice, points_px: FloatArray) -> int:
    distance_px = np.linalg.norm(candidates_px - origin_px, axis=1)
    nearest = int(np.argmin(distance_px))
    limit_px = shortest_step_px(lattice, points_px)
    if distance_px[nearest] > limit_px:
        raise TargetNotFound(
            f"origin_px: the nearest point of the target is {distance_px[nearest]:.1f} px away from "
            f"{tuple(origin_px)}, more than one step of {limit_px:.1f} px"
        )
    return nearest
