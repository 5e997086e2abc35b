"""How well the points determine a mapping: covariance of its parameters, and what it means in the image."""

from itertools import product

import numpy as np

from processing.calibration.calibration import Model, ParameterCovariance, ViewCalibration
from processing.calibration.fit.least_squares import one_blas_thread
from processing.calibration.fit.pinhole_fit import PARAMETER_NAMES, PINHOLE_PARAMETERS, camera_derivatives
from processing.calibration.fit.polynomial import COEFFICIENT_NAMES, polynomial_derivatives
from processing.calibration.polynomial_mapping import PolynomialMapping
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
    residuals_px = mapping.project(points_mm) - image_px
    freedom = residuals_px.size - len(_names(model))
    return least_covariance(mapping, points_mm, model, float(np.sqrt((residuals_px**2).sum() / max(freedom, 1))))


def least_covariance(mapping: ViewMapping, points_mm: FloatArray, model: Model, noise_px: float) -> ParameterCovariance:
    """Covariance of the best unbiased fit to points that are seen with normal noise (bound of Cramér and Rao).

    Parameters
    ----------
    mapping : ViewMapping
        The truth, or a fit close to it.
    points_mm : (N, 3) array
        The points of the fit.
    model : Model
        What is fitted.
    noise_px : float
        Standard deviation of the noise, per coordinate.
    """
    jacobian = _derivatives(mapping, points_mm, model)
    scale = np.linalg.norm(jacobian, axis=0)
    with one_blas_thread():
        triangle = np.linalg.qr(jacobian / scale, mode="r")
    root = noise_px * np.linalg.inv(triangle) / scale[:, None]
    return ParameterCovariance(_names(model), _rounded(np.triu(root)))


def position_std_px(view: ViewCalibration, points_mm: FloatArray) -> FloatArray | None:
    """Standard deviation (N,) of where a view sees points, as far as its fit is to blame; None where not known."""
    if view.covariance is None:
        return None
    return _lengths_px(image_spread_px(view.mapping, view.covariance, points_mm, view.model))


def image_spread_px(
    mapping: ViewMapping, covariance: ParameterCovariance, points_mm: FloatArray, model: Model
) -> FloatArray:
    """What a covariance means in the image: (2 N, P), u before v; times its transpose, the covariance of image points.

    Times P normal deviates it is an error of the image points that such a fit may have.
    """
    return np.asarray(_derivatives(mapping, points_mm, model) @ covariance.root, dtype=np.float64)


def _lengths_px(spread_px: FloatArray) -> FloatArray:
    """Root of the variances (N,) of u and v together."""
    return np.asarray(np.sqrt((spread_px**2).sum(axis=1).reshape(-1, 2).sum(axis=1)), dtype=np.float64)


def _names(model: Model) -> tuple[str, ...]:
    if model is Model.POLYNOMIAL:
        return COEFFICIENT_NAMES
    return PARAMETER_NAMES if model is Model.PINHOLE_TILTED else PARAMETER_NAMES[:PINHOLE_PARAMETERS]


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
