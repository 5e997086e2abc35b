"""Small smooth corrections of a mapping: a camera that was knocked moved as a whole.

A pinhole camera is turned around its centre and shifted; its lens stays. A polynomial mapping gets a linear
field added. Corrections are vectors whose elements are of the order of the pixels that they move the image by.
"""

import cv2
import numpy as np

from processing.calibration.polynomial_mapping import EXPONENTS, PolynomialMapping
from processing.geometry import FloatArray, PinholeCamera, ViewMapping

_STEP = 0.1
_LINEAR = tuple(EXPONENTS.index(exponent) for exponent in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)))


def correction_size(mapping: ViewMapping) -> int:
    """Number of elements of a correction."""
    return 2 * len(_LINEAR) if isinstance(mapping, PolynomialMapping) else 6


def corrected(mapping: ViewMapping, correction: FloatArray) -> ViewMapping:
    """The mapping after a correction; zeros change nothing.

    Parameters
    ----------
    mapping : ViewMapping
        A pinhole camera or a polynomial.
    correction : (6,) or (8,) array
        Pinhole: turn and shift along the three axes of the camera. Polynomial: what is added to the constant, x,
        y and z terms of u and v.
    """
    match mapping:
        case PinholeCamera():
            return _moved(mapping, correction)
        case PolynomialMapping():
            coefficients = mapping.coefficients.copy()
            coefficients[list(_LINEAR)] += correction.reshape(len(_LINEAR), 2)
            return PolynomialMapping(coefficients, mapping.centre_mm, mapping.scale_mm, mapping.image_size_px)
        case _:
            raise TypeError(f"no correction for a mapping of type {type(mapping).__name__}")


def sensitivity(mapping: ViewMapping, points_mm: FloatArray) -> FloatArray:
    """Derivatives (N, 2, P) of image points by the elements of a correction."""
    columns = []
    for step in _STEP * np.eye(correction_size(mapping)):
        ahead_px = corrected(mapping, step).project(points_mm)
        columns.append((ahead_px - corrected(mapping, -step).project(points_mm)) / (2 * _STEP))
    return np.stack(columns, axis=-1)


def _moved(camera: PinholeCamera, correction: FloatArray) -> PinholeCamera:
    focal_px = float(camera.camera_matrix[0, 0])
    distance_mm = float(np.linalg.norm(camera.translation_mm))
    turn = np.asarray(cv2.Rodrigues(correction[:3] / focal_px)[0], dtype=np.float64)
    return PinholeCamera(
        camera_matrix=camera.camera_matrix,
        rotation=turn @ camera.rotation,
        translation_mm=turn @ camera.translation_mm + correction[3:] * distance_mm / focal_px,
        image_size_px=camera.image_size_px,
        distortion=camera.distortion,
        tilt_rad=camera.tilt_rad,
    )
