"""Least squares for a few parameters and many points: Levenberg and Marquardt on the normal equations.

A camera has 15 to 17 parameters and thousands of points; the small normal equations, their columns scaled, are
exact enough and an order of magnitude quicker than a decomposition of the whole Jacobian. Products of a few columns are
too small for the threads of a BLAS, which would wait for each other for three times as long as the work takes.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import cache

import numpy as np
from threadpoolctl import ThreadpoolController

from processing.geometry import FloatArray

ROBUST_SCALE = 3.0
"""Residuals beyond so many times their typical size count less in the first pass of a fit."""
REJECT_SCALE = 6.0
"""Points beyond so many times that size are wrong and left out of the second pass."""
REJECT_FLOOR_PX = 0.1
"""Points this close to the model are never left out."""

MAX_TRIALS = 150
"""Steps that are tried, those that lead upwards included."""
TOLERANCE = 1e-8
"""Relative fall of the cost below which the fit has converged."""
HARDER, EASIER = 2.0, 5.0
"""Change of the damping after a bad and a good step; the fit creeps along valleys where it rises faster."""
MAX_DAMPING = 1e8
"""Where even the shortest steps lead upwards, the fit is at the bottom."""

Function = Callable[[FloatArray], FloatArray]


def minimise(
    residuals_at: Function, derivatives_at: Function, start: FloatArray, robust_scale: float | None = None
) -> FloatArray:
    """Parameters of least residuals.

    Parameters
    ----------
    residuals_at : callable
        Parameters (P,) to residuals (N, 2).
    derivatives_at : callable
        Parameters (P,) to the derivatives (2 N, P) of the residuals.
    start : (P,) array
        First guess.
    robust_scale : float, optional
        Length of a residual from which on it counts less (Cauchy's loss); by default all count the same.

    Returns
    -------
    (P,) array
        The best parameters found, finite as the first guess is; they may be far from any that fit.
    """
    with one_blas_thread(), np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return _descend(residuals_at, derivatives_at, np.array(start, dtype=np.float64), robust_scale)


def one_blas_thread() -> AbstractContextManager[object]:
    """While it is entered, products and decompositions of a few columns do not wait for threads."""
    limited: AbstractContextManager[object] = _blas().limit(limits=1, user_api="blas")
    return limited


@cache
def _blas() -> ThreadpoolController:
    """The thread pools of this process; to look for them takes longer than a fit."""
    return ThreadpoolController()


def _descend(
    residuals_at: Function, derivatives_at: Function, parameters: FloatArray, robust_scale: float | None
) -> FloatArray:
    damping = 1e-3
    residuals = residuals_at(parameters)
    cost, weights = _cost_and_weights(residuals, robust_scale)
    matrix, gradient, scale = _normal_equations(residuals, derivatives_at(parameters), weights)
    for _ in range(MAX_TRIALS):
        if not np.isfinite(matrix).all():
            break
        step = np.linalg.solve(matrix + damping * np.eye(len(matrix)), gradient) / scale
        residuals = residuals_at(parameters - step)
        new_cost, weights = _cost_and_weights(residuals, robust_scale)
        if not new_cost <= cost:
            damping *= HARDER
            if damping > MAX_DAMPING:
                break
            continue
        converged = cost - new_cost <= TOLERANCE * cost
        parameters, cost, damping = parameters - step, new_cost, max(damping / EASIER, 1e-14)
        if converged:
            break
        matrix, gradient, scale = _normal_equations(residuals, derivatives_at(parameters), weights)
    return parameters


def _normal_equations(
    residuals: FloatArray, jacobian: FloatArray, weights: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Matrix (P, P) and right side (P,) for steps in units of 1 / scale (P,)."""
    weighted = jacobian * np.repeat(weights, 2)[:, None]
    matrix, gradient = weighted.T @ jacobian, weighted.T @ residuals.ravel()
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    return matrix / np.outer(scale, scale), gradient / scale, scale


def _cost_and_weights(residuals: FloatArray, robust_scale: float | None) -> tuple[float, FloatArray]:
    squared = (residuals**2).sum(axis=1)
    if robust_scale is None:
        return float(squared.sum()), np.ones(len(squared))
    relative = squared / robust_scale**2
    return float(np.log1p(relative).sum()) * robust_scale**2, 1 / (1 + relative)
