"""How well the points determine a mapping: covariance of its parameters, and what it means in the image."""

from itertools import product

import numpy as np

from processing.calibration.calibration import Model, ParameterCovariance, ViewCalibration
from processing.calibration.pinhole_fit import PARAMETER_NAMES, camera_derivatives
from processing.calibration.polynomial import COEFFICIENT_NAMES, PolynomialMapping, polynomial_derivatives
from processing.geometry import FloatArray, PinholeCamera, ViewMapping

_DIGITS = 6
"""Significant digits that are kept; parameters are correlated, but their root is not."""


def parameter_covariance(
    mapping: ViewMapping, points_mm: FloatArray, image_px: FloatArray, model: Model
) -> ParameterCovariance:
    """Covariance of a fitted mapping, from the Jacobian at the solution and the variance of the residuals.

    Parameters
    ----------
    mapping : ViewMapping
        The fit.
    points_mm, image_px : (N, 3) and (N, 2) arrays
        The points it was fitted to.
    model : Model
        What was fitted.
    """
    jacobian = _derivatives(mapping, points_mm, model)
    residuals_px = mapping.project(points_mm) - image_px
    freedom = residuals_px.size - jacobian.shape[1]
    deviation_px = float(np.sqrt((residuals_px**2).sum() / max(freedom, 1)))
    scale = np.linalg.norm(jacobian, axis=0)
    triangle = np.linalg.qr(jacobian / scale, mode="r")
    root = deviation_px * np.linalg.inv(triangle) / scale[:, None]
    names = COEFFICIENT_NAMES if model is Model.POLYNOMIAL else PARAMETER_NAMES[: len(root)]
    return ParameterCovariance(names, _rounded(np.triu(root)))


def position_std_px(view: ViewCalibration, points_mm: FloatArray) -> FloatArray | None:
    """Standard deviation (N,) of where a view sees points, as far as its fit is to blame; None where not known."""
    if view.covariance is None:
        return None
    spread_px = _derivatives(view.mapping, points_mm, view.model) @ view.covariance.root
    return np.asarray(np.sqrt((spread_px**2).sum(axis=1).reshape(-1, 2).sum(axis=1)), dtype=np.float64)


def _derivatives(mapping: ViewMapping, points_mm: FloatArray, model: Model) -> FloatArray:
    """Derivatives (2 N, P) of image points by the parameters, u before v."""
    match mapping:
        case PinholeCamera():
            return camera_derivatives(mapping, points_mm, tilted=model is Model.PINHOLE_TILTED)
        case PolynomialMapping():
            return polynomial_derivatives(mapping, points_mm)
        case _:
            raise TypeError(f"no derivatives of a mapping of type {type(mapping).__name__}")


def worst_position_std_px(view: ViewCalibration) -> float | None:
    """Largest standard deviation within the points that the view was calibrated with."""
    depths_mm = [plane.z_mm for plane in view.planes if plane.z_mm is not None]
    if not view.extent_mm or not depths_mm:
        return None
    corners_mm = [(x, y, z) for (x, y), z in product(view.extent_mm, (min(depths_mm), max(depths_mm)))]
    spread_px = position_std_px(view, np.array(corners_mm))
    return None if spread_px is None else float(spread_px.max())


def _rounded(values: FloatArray) -> FloatArray:
    return np.array([[float(f"{value:.{_DIGITS}g}") for value in row] for row in values])
