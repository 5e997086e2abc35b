"""Soloff's polynomial mapping: third order in x and y, second in z. For views that no pinhole describes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.calibration.errors import CalibrationError
from processing.calibration.fit.least_squares import REJECT_FLOOR_PX, REJECT_SCALE, ROBUST_SCALE
from processing.geometry import FloatArray

ORDER, ORDER_Z = 3, 2
EXPONENTS = tuple(
    (i, j, k) for k in range(ORDER_Z + 1) for j in range(ORDER + 1) for i in range(ORDER + 1) if i + j + k <= ORDER
)
"""Powers of x, y and z of the 19 terms (Soloff, Adrian and Liu 1997)."""
COEFFICIENT_NAMES = tuple(f"{axis}_x{i}_y{j}_z{k}_px" for axis in "uv" for i, j, k in EXPONENTS)
"""Of all 38 coefficients, those of u before those of v."""


@dataclass(frozen=True, eq=False)
class PolynomialMapping:
    """Image points as polynomials of normalised world coordinates; trustworthy only where it was fitted.

    Parameters
    ----------
    coefficients : (19, 2) array
        For u and v, in px, in the order of ``EXPONENTS``.
    centre_mm, scale_mm : (3,) arrays
        World point w enters as (w - centre) / scale.
    image_size_px : tuple[int, int]
        (width, height).
    """

    coefficients: FloatArray
    centre_mm: FloatArray
    scale_mm: FloatArray
    image_size_px: tuple[int, int]

    def project(self, points_mm: FloatArray) -> FloatArray:
        """Image points (N, 2) in px of world points (N, 3) in mm."""
        return np.asarray(self.terms(points_mm) @ self.coefficients, dtype=np.float64)

    def terms(self, points_mm: FloatArray) -> FloatArray:
        """The 19 terms (N, 19) at world points (N, 3) in mm."""
        points_mm = np.asarray(points_mm, dtype=np.float64).reshape(-1, 3)
        return _terms((points_mm - self.centre_mm) / self.scale_mm)


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
    terms = _terms((points_mm - centre_mm) / scale_mm)
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


def _terms(normalised: FloatArray) -> FloatArray:
    x, y, z = normalised.T
    return np.stack([x**i * y**j * z**k for i, j, k in EXPONENTS], axis=1)


def _solve(terms: FloatArray, image_px: FloatArray, weights: FloatArray) -> FloatArray:
    solution, *_ = np.linalg.lstsq(terms * weights[:, None], image_px * weights[:, None], rcond=None)
    return np.asarray(solution, dtype=np.float64)
