"""Least squares for a few parameters and many points: Levenberg and Marquardt on the normal equations.

A camera has 15 to 17 parameters and thousands of points; the small normal equations, their columns scaled, are
exact enough and an order of magnitude quicker than a decomposition of the whole Jacobian.
"""

from collections.abc import Callable

import numpy as np

from processing.geometry import FloatArray

MAX_STEPS = 100
TOLERANCE = 1e-8
"""Relative fall of the cost below which the fit has converged."""

Model = Callable[[FloatArray], tuple[FloatArray, FloatArray]]


def minimise(model: Model, start: FloatArray, robust_scale: float | None = None) -> FloatArray:
    """Parameters of least residuals.

    Parameters
    ----------
    model : callable
        Parameters (P,) to residuals (N, 2) and their derivatives (2 N, P).
    start : (P,) array
        First guess.
    robust_scale : float, optional
        Length of a residual from which on it counts less (Cauchy's loss); by default all count the same.

    Returns
    -------
    (P,) array
        The best parameters found.
    """
    parameters, damping = np.array(start, dtype=np.float64), 1e-3
    residuals, jacobian = model(parameters)
    cost, weights = _cost_and_weights(residuals, robust_scale)
    for _ in range(MAX_STEPS):
        weighted = jacobian * np.repeat(weights, 2)[:, None]
        matrix, gradient = weighted.T @ jacobian, weighted.T @ residuals.ravel()
        scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
        matrix, gradient = matrix / np.outer(scale, scale), gradient / scale
        step = np.linalg.solve(matrix + damping * np.eye(len(matrix)), gradient) / scale
        new_residuals, new_jacobian = model(parameters - step)
        new_cost, new_weights = _cost_and_weights(new_residuals, robust_scale)
        if new_cost > cost or not np.isfinite(new_cost):
            damping *= 10
            if damping > 1e8:
                break
            continue
        converged = cost - new_cost <= TOLERANCE * cost
        parameters, residuals, jacobian, weights = parameters - step, new_residuals, new_jacobian, new_weights
        cost, damping = new_cost, max(damping / 10, 1e-14)
        if converged:
            break
    return parameters


def _cost_and_weights(residuals: FloatArray, robust_scale: float | None) -> tuple[float, FloatArray]:
    squared = (residuals**2).sum(axis=1)
    if robust_scale is None:
        return float(squared.sum()), np.ones(len(squared))
    relative = squared / robust_scale**2
    return float(np.log1p(relative).sum()) * robust_scale**2, 1 / (1 + relative)
