"""The fit of a polynomial mapping, and how its image points depend on its coefficients."""

import numpy as np
from numpy.typing import NDArray

from processing.calibration.errors import CalibrationError
from processing.calibration.fit.least_squares import REJECT_FLOOR_PX, REJECT_SCALE, ROBUST_SCALE, one_blas_thread
from processing.calibration.polynomial_mapping import EXPONENTS, ORDER_Z, PolynomialMapping, polynomial_terms
from processing.geometry import FloatArray

COEFFICIENT_NAMES = tuple(f"{axis}_x{i}_y{j}_z{k}_px" for axis in "uv" for i, j, k in EXPONENTS)
"""Of all 38 coefficients, those of u before those of v."""


def fit_polynomial(
    points_mm: FloatArray, image_px: FloatArray, image_size_px: tuple[int, int]
) -> tuple[PolynomialMapping, NDArray[np.bool_]]:
    """Fit the mapping; wrong points lose their weight, then are left out.

    Parameters
    ----------
    points_mm : (N, 3) array
        World points on at least three planes.
    image_px : (N, 2) array
        Where they are seen.
    image_size_px : tuple[int, int]
        (width, height).

    Returns
    -------
    PolynomialMapping, (N,) array
        The mapping, and which points it was fitted to.

    Raises
    ------
    CalibrationError
        The points do not determine the 19 terms.
    """
    centre_mm, scale_mm = points_mm.mean(axis=0), np.maximum(np.ptp(points_mm, axis=0) / 2, 1e-9)
    terms = polynomial_terms((points_mm - centre_mm) / scale_mm)
    if len(points_mm) < 2 * len(EXPONENTS) or np.linalg.matrix_rank(terms, tol=1e-6 * len(terms) ** 0.5) < len(
        EXPONENTS
    ):
        raise CalibrationError(
            f"{len(points_mm)} points do not determine a polynomial of {len(EXPONENTS)} terms; "
            f"it needs {2 * len(EXPONENTS)} points on {ORDER_Z + 1} planes with 4 columns and rows each"
        )
    weights = np.ones(len(points_mm))
    for _ in range(10):
        coefficients = _solve(terms, image_px, weights)
        residual_px = np.linalg.norm(terms @ coefficients - image_px, axis=1)
        scale_px = max(float(np.median(residual_px)), 1e-4)
        weights = 1 / (1 + (residual_px / (ROBUST_SCALE * scale_px)) ** 2)
    used = residual_px < max(REJECT_SCALE * scale_px, REJECT_FLOOR_PX)
    coefficients = _solve(terms[used], image_px[used], np.ones(int(used.sum())))
    return PolynomialMapping(coefficients, centre_mm, scale_mm, image_size_px), np.asarray(used, dtype=np.bool_)


def polynomial_derivatives(mapping: PolynomialMapping, points_mm: FloatArray) -> FloatArray:
    """Derivatives (2 N, 38) of image points by the coefficients of ``COEFFICIENT_NAMES``, u before v."""
    terms = mapping.terms(points_mm)
    derivatives = np.zeros((len(terms), 2, 2, len(EXPONENTS)))
    derivatives[:, 0, 0] = derivatives[:, 1, 1] = terms
    return derivatives.reshape(2 * len(terms), len(COEFFICIENT_NAMES))


def _solve(terms: FloatArray, image_px: FloatArray, weights: FloatArray) -> FloatArray:
    with one_blas_thread():
        solution, *_ = np.linalg.lstsq(terms * weights[:, None], image_px * weights[:, None], rcond=None)
    return np.asarray(solution, dtype=np.float64)
