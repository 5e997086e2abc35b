"""Lines of sight of any mapping: image points back into space, and points in space from several views."""

from collections.abc import Sequence

import numpy as np

from processing.geometry import FloatArray, ViewMapping

_STEP_MM = 0.05
_STEP_RANGE_PX, _STEP_PX = (0.3, 30.0), 3.0
"""Steps that the images show by less or more are made such that they show them by 3 px: metres and micrometres too."""
_ITERATIONS = 8


def linearise(mapping: ViewMapping, points_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Image points (N, 2) of world points (N, 3), and their derivatives (N, 2, 3) in px/mm."""
    image_px = mapping.project(points_mm)
    step_mm = _STEP_MM
    for _ in range(_ITERATIONS):
        slopes = _differences(mapping, points_mm, image_px, step_mm)
        shown_px = step_mm * float(np.median(np.linalg.norm(slopes, axis=(1, 2)))) if len(slopes) else _STEP_PX
        if not shown_px or _STEP_RANGE_PX[0] < shown_px < _STEP_RANGE_PX[1]:
            break
        step_mm *= _STEP_PX / shown_px
    return image_px, slopes


def _differences(mapping: ViewMapping, points_mm: FloatArray, image_px: FloatArray, step_mm: float) -> FloatArray:
    ahead_px = [mapping.project(points_mm + step) for step in step_mm * np.eye(3)]
    return np.stack([(there_px - image_px) / step_mm for there_px in ahead_px], axis=-1)


def back_project(mapping: ViewMapping, image_px: FloatArray, z_mm: float, near_mm: FloatArray) -> FloatArray:
    """World points (N, 3) on the plane z that a mapping of any kind sees at image points (N, 2).

    Parameters
    ----------
    mapping : ViewMapping
        The view.
    image_px : (N, 2) array
        Where the points are seen.
    z_mm : float
        Their plane.
    near_mm : (3,) array
        A point of the measured volume, from where the search starts.
    """
    points_mm = np.tile([near_mm[0], near_mm[1], z_mm], (len(image_px), 1)).astype(np.float64)
    for _ in range(_ITERATIONS):
        seen_px, slopes = linearise(mapping, points_mm)
        step_mm = np.linalg.solve(slopes[:, :, :2], (image_px - seen_px)[:, :, None])[:, :, 0]
        points_mm[:, :2] += step_mm
        if not len(step_mm) or np.abs(step_mm).max() < 1e-7:
            break
    return points_mm


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
        First guess.
    iterations : int
        Gauss-Newton steps; in a volume that is small against its distance one is nearly exact.

    Returns
    -------
    (N, 3) array, (N, n, 2) array
        The points, and what is left: seen minus re-projected, in px.
    """
    points_mm = np.array(start_mm, dtype=np.float64)
    for _ in range(iterations):
        seen = [linearise(mapping, points_mm) for mapping in mappings]
        slopes = np.concatenate([slope for _, slope in seen], axis=1)
        residual_px = np.concatenate([seen_px[:, view] - image for view, (image, _) in enumerate(seen)], axis=1)
        normal = slopes.transpose(0, 2, 1) @ slopes
        points_mm += np.linalg.solve(normal, slopes.transpose(0, 2, 1) @ residual_px[:, :, None])[:, :, 0]
    reprojected_px = np.stack([mapping.project(points_mm) for mapping in mappings], axis=1)
    return points_mm, seen_px - reprojected_px


def unseen(slopes: FloatArray) -> FloatArray:
    """Projector (..., 2 n, 2 n) onto what no displacement of the point explains; slopes are (..., n, 2, 3)."""
    flat = slopes.reshape(*slopes.shape[:-3], -1, 3)
    explained = flat @ np.linalg.pinv(flat)
    return np.asarray(np.eye(flat.shape[-2]) - explained, dtype=np.float64)


def crossing_angle_rad(mappings: Sequence[ViewMapping], point_mm: FloatArray) -> FloatArray:
    """Angles (n, n) between the lines of sight of all views through one point."""
    slopes = [linearise(mapping, point_mm[None])[1][0] for mapping in mappings]
    directions = np.array([np.cross(slope[0], slope[1]) for slope in slopes])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.asarray(np.arccos(np.clip(np.abs(directions @ directions.T), 0, 1)), dtype=np.float64)
