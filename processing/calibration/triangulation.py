"""Lines of sight of any mapping: image points back into space, and points in space from several views."""

from collections.abc import Sequence

import numpy as np

from processing.geometry import FloatArray, ViewMapping

_STEP_MM = 0.05
_STEP_RANGE_PX, _STEP_PX = (0.3, 30.0), 3.0
"""Steps that the images show by less or more are made such that they show them by 3 px: metres and micrometres too."""
_ASKED = 64
"""Points that tell what a step shows: it need not be known well."""
_ITERATIONS = 8
_POINTS_AT_ONCE = 4096
"""Of a triangulation: so many stay in the cache from step to step."""
_FIRMNESS = 1e-12
"""Share of the normal matrix that is added to it, so that it can be solved where views stand in one place."""


def linearise(mapping: ViewMapping, points_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Image points (N, 2) of world points (N, 3), and their derivatives (N, 2, 3) in px/mm."""
    step_mm = _STEP_MM
    for _ in range(_ITERATIONS):
        image_px, slopes = _differences(mapping, points_mm, step_mm)
        some = slopes[:: 1 + len(slopes) // _ASKED]
        shown_px = step_mm * float(np.median(np.linalg.norm(some, axis=(1, 2)))) if len(some) else _STEP_PX
        if not shown_px or _STEP_RANGE_PX[0] < shown_px < _STEP_RANGE_PX[1]:
            break
        step_mm *= _STEP_PX / shown_px
    return image_px, slopes


def _differences(mapping: ViewMapping, points_mm: FloatArray, step_mm: float) -> tuple[FloatArray, FloatArray]:
    """Image points and difference quotients, all projected at once: most are asked of a few points only."""
    steps_mm = step_mm * np.vstack([np.zeros(3), np.eye(3)])
    here_px, *ahead_px = mapping.project((points_mm + steps_mm[:, None]).reshape(-1, 3)).reshape(4, -1, 2)
    return here_px, np.stack([(there_px - here_px) / step_mm for there_px in ahead_px], axis=-1)


def back_project(
    mapping: ViewMapping, image_px: FloatArray, near_mm: FloatArray, axis: int, place_mm: float
) -> FloatArray:
    """World points (N, 3) on a plane that a mapping of any kind sees at image points (N, 2).

    Parameters
    ----------
    mapping : ViewMapping
        The view.
    image_px : (N, 2) array
        Where the points are seen.
    near_mm : (3,) array
        A point of the measured volume, from where the search starts.
    axis : int
        The plane's normal: 0 is x, 1 is y, 2 is z. Lines of sight must cross the plane: see ``steepest_axis``.
    place_mm : float
        Where the plane is on that axis.
    """
    points_mm = np.tile(np.asarray(near_mm, dtype=np.float64), (len(image_px), 1))
    points_mm[:, axis] = place_mm
    within = [number for number in range(3) if number != axis]
    for _ in range(_ITERATIONS):
        seen_px, slopes = linearise(mapping, points_mm)
        step_mm = np.linalg.solve(slopes[:, :, within], (image_px - seen_px)[:, :, None])[:, :, 0]
        points_mm[:, within] += step_mm
        if not len(step_mm) or np.abs(step_mm).max() < 1e-7:
            break
    return points_mm


def steepest_axis(mapping: ViewMapping, point_mm: FloatArray) -> int:
    """The axis of the world that the line of sight through a point runs along most."""
    return int(np.abs(_direction(mapping, point_mm)).argmax())


def triangulate(
    mappings: Sequence[ViewMapping], seen_px: FloatArray, start_mm: FloatArray, iterations: int = 2
) -> tuple[FloatArray, FloatArray]:
    """Points in space from where several views see them: least squares of the distances in the images.

    Parameters
    ----------
    mappings : sequence of ViewMapping
        The n views.
    seen_px : (N, n, 2) array
        Where each view sees each point.
    start_mm : (N, 3) array
        First guess; where all lines of sight are one, a point keeps its place along it.
    iterations : int
        Gauss-Newton steps; in a volume that is small against its distance one is nearly exact.

    Returns
    -------
    (N, 3) array, (N, n, 2) array
        The points, and what is left: seen minus re-projected, in px.
    """
    points_mm, left_px = np.array(start_mm, dtype=np.float64), np.empty(np.shape(seen_px))
    for first in range(0, len(points_mm), _POINTS_AT_ONCE):
        some = slice(first, first + _POINTS_AT_ONCE)
        for _ in range(iterations):
            points_mm[some] += _step_mm(mappings, seen_px[some], points_mm[some])
        reprojected_px = [mapping.project(points_mm[some]) for mapping in mappings]
        left_px[some] = seen_px[some] - np.stack(reprojected_px, axis=1)
    return points_mm, left_px


def _step_mm(mappings: Sequence[ViewMapping], seen_px: FloatArray, points_mm: FloatArray) -> FloatArray:
    """One Gauss-Newton step (N, 3), as ``triangulate`` takes it."""
    normal, gradient = np.zeros((3, 3, len(points_mm))), np.zeros((3, len(points_mm)))
    for view, mapping in enumerate(mappings):
        image_px, slopes = linearise(mapping, points_mm)
        left_px, along = (seen_px[:, view] - image_px).T, np.ascontiguousarray(slopes.transpose(1, 2, 0))
        for slope, left in zip(along, left_px, strict=True):
            gradient += slope * left
            for row in range(3):
                normal[row, row:] += slope[row] * slope[row:]
    normal[range(3), range(3)] += _FIRMNESS * (normal[0, 0] + normal[1, 1] + normal[2, 2])
    return _solved(normal, gradient)


def _solved(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solutions (N, 3) of symmetric systems, whose upper halves (3, 3, N) are given, by Cramer's rule."""
    (aa, ab, ac), (_, bb, bc), (_, _, cc) = matrix
    adjugate_a, adjugate_b, adjugate_c = bb * cc - bc * bc, ac * bc - ab * cc, ab * bc - ac * bb
    determinant = aa * adjugate_a + ab * adjugate_b + ac * adjugate_c
    adjugate = np.array(
        [
            [adjugate_a, adjugate_b, adjugate_c],
            [adjugate_b, aa * cc - ac * ac, ab * ac - aa * bc],
            [adjugate_c, ab * ac - aa * bc, aa * bb - ab * ab],
        ]
    )
    return np.asarray((adjugate * right).sum(axis=1).T / determinant[:, None], dtype=np.float64)


def unseen(slopes: FloatArray) -> FloatArray:
    """Projector (..., 2 n, 2 n) onto what no displacement of the point explains; slopes are (..., n, 2, 3)."""
    flat = slopes.reshape(*slopes.shape[:-3], -1, 3)
    explained = flat @ np.linalg.pinv(flat)
    return np.asarray(np.eye(flat.shape[-2]) - explained, dtype=np.float64)


def crossing_angle_rad(mappings: Sequence[ViewMapping], point_mm: FloatArray) -> FloatArray:
    """Angles (n, n) between the lines of sight of all views through one point."""
    directions = np.array([_direction(mapping, point_mm) for mapping in mappings])
    return np.asarray(np.arccos(np.clip(np.abs(directions @ directions.T), 0, 1)), dtype=np.float64)


def _direction(mapping: ViewMapping, point_mm: FloatArray) -> FloatArray:
    """Unit vector (3,) along the line of sight through a point: along it, neither u nor v changes."""
    slope_u, slope_v = linearise(mapping, point_mm[None])[1][0]
    along = np.cross(slope_u, slope_v)
    return np.asarray(along / np.linalg.norm(along), dtype=np.float64)
