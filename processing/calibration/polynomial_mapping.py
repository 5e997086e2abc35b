"""Soloff's polynomial mapping: third order in x and y, second in z. For views that no pinhole describes."""

from dataclasses import dataclass

import numpy as np

from processing.geometry import FloatArray

ORDER, ORDER_Z = 3, 2
EXPONENTS = tuple(
    (i, j, k) for k in range(ORDER_Z + 1) for j in range(ORDER + 1) for i in range(ORDER + 1) if i + j + k <= ORDER
)
"""Powers of x, y and z of the 19 terms (Soloff, Adrian and Liu 1997)."""


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
        return polynomial_terms((points_mm - self.centre_mm) / self.scale_mm)


def polynomial_terms(normalised: FloatArray) -> FloatArray:
    """The 19 terms (N, 19) at normalised world points (N, 3)."""
    x, y, z = normalised.T
    return np.stack([x**i * y**j * z**k for i, j, k in EXPONENTS], axis=1)
