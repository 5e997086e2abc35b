"""Aim: a camera told by what its image shows, in parameters that hardly depend on each other.

Seen from afar, focal length and distance, principal point and rotation, rotation and tilt of the sensor change the
image in almost the same way. A fit of these walks along narrow curved valleys and stops half-way. Where the middle
of the target is seen, how large, from which direction and how obliquely is plain from the image; in these values
the same fit takes a handful of steps.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from processing.geometry import FloatArray, rotation_vector_of

_KILO_PX = 1000.0
"""Image positions count in units of so many px, so that all values are of the order of 1."""
_STEP = 1e-6
_CENTRE, _LENS, _TILT = slice(8, 10), slice(10, 15), slice(15, 17)
"""Where principal point, distortion and tilt stand; the first two in values as in parameters."""


@dataclass(frozen=True, eq=False)
class Aim:
    """From parameters in OpenCV's sense to values and back, near one camera.

    Parameters are rotation vector (3), translation (3), focal lengths (2), principal point (2), distortion (5) and,
    if the sensor is tilted, its tilt (2). Values are the direction of the view (2), the roll around it, the distance
    relative to where the fit began, where the middle is seen (2), the scale there (2), principal point (2), distortion
    (5) and, with a tilt, how obliquely the line of sight to the middle meets the sensor (2).

    Parameters
    ----------
    middle_mm : (3,) array
        Middle of the target.
    frame : (3, 3) array
        Rotation to axes of which the third is the first guess of the view's direction.
    distance_mm : float
        First guess of the distance; negative where left-handed axes put the target behind the camera.
    """

    middle_mm: FloatArray
    frame: FloatArray
    distance_mm: float

    @classmethod
    def at(cls, parameters: FloatArray, middle_mm: FloatArray) -> "Aim":
        """Around the camera where a fit begins."""
        rotation, ray, distance_mm = _line_of_sight(parameters, middle_mm)
        return cls(middle_mm, _to_axis(ray) @ rotation, distance_mm)

    def values(self, parameters: FloatArray) -> FloatArray:
        """What the image shows of a camera with these parameters (15,) or (17,)."""
        rotation, ray, distance_mm = _line_of_sight(parameters, self.middle_mm)
        focal_px, centre_px, tilt_rad = parameters[6:8], parameters[_CENTRE], parameters[_TILT]
        tilt = _tilt_matrix(tilt_rad)
        seen = tilt @ ray
        seen_px = centre_px + focal_px * seen[:2] / seen[2]
        scale_px = focal_px * _scales(tilt)
        direction = self.frame @ rotation.T @ ray
        roll = _to_axis(ray) @ rotation @ self.frame.T @ _to_axis(direction).T
        oblique = _obliquity(seen_px, centre_px, scale_px)[: len(tilt_rad)] + tilt_rad
        return np.concatenate(
            [
                direction[:2] / direction[2],
                [np.arctan2(roll[1, 0], roll[0, 0]), distance_mm / self.distance_mm],
                seen_px / _KILO_PX,
                scale_px / distance_mm,
                centre_px / _KILO_PX,
                parameters[_LENS],
                oblique,
            ]
        )

    def parameters(self, values: FloatArray) -> FloatArray:
        """Parameters (15,) or (17,) of the camera that shows this."""
        distance_mm = values[3] * self.distance_mm
        seen_px, centre_px, scale_px = values[4:6] * _KILO_PX, values[_CENTRE] * _KILO_PX, values[6:8] * distance_mm
        oblique = values[_TILT]
        tilt_rad = oblique - _obliquity(seen_px, centre_px, scale_px)[: len(oblique)]
        tilt = _tilt_matrix(tilt_rad)
        focal_px = scale_px / _scales(tilt)
        ray = _unit(np.linalg.solve(tilt, np.append((seen_px - centre_px) / focal_px, 1.0)))
        roll = np.array(cv2.Rodrigues(np.array([0.0, 0.0, values[2]]))[0])
        rotation = _to_axis(ray).T @ roll @ _to_axis(_unit(np.append(values[:2], 1.0))) @ self.frame
        translation_mm = distance_mm * ray - rotation @ self.middle_mm
        turn = rotation_vector_of(rotation)
        return np.concatenate([turn, translation_mm, focal_px, centre_px, values[_LENS], tilt_rad])

    def derivatives(self, values: FloatArray) -> FloatArray:
        """Derivatives (P, P) of the parameters by the values."""
        here, change = self.parameters(values), np.eye(len(values))
        for number in [*range(_LENS.start), *range(_LENS.stop, len(values))]:
            ahead = self.parameters(values + _STEP * np.eye(len(values))[number])
            change[:, number] = (ahead - here) / _STEP
        return change

    def with_centre(self, parameters: FloatArray, centre_px: FloatArray) -> FloatArray:
        """A camera with another principal point that shows almost the same, as its sensor is tilted instead."""
        values = self.values(parameters)
        values[_CENTRE] = centre_px / _KILO_PX
        return self.parameters(values)


def _line_of_sight(parameters: FloatArray, middle_mm: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Rotation (3, 3), unit vector towards the middle in camera axes, its third element positive, and distance."""
    rotation = np.asarray(cv2.Rodrigues(parameters[:3])[0], dtype=np.float64)
    offset_mm = rotation @ middle_mm + parameters[3:6]
    distance_mm = float(np.copysign(np.linalg.norm(offset_mm), offset_mm[2]))
    return rotation, offset_mm / distance_mm, distance_mm


def _obliquity(seen_px: FloatArray, centre_px: FloatArray, scale_px: FloatArray) -> FloatArray:
    """Angles (2,) at which a line of sight beside the optical axis meets the sensor, as tilts of OpenCV's sense."""
    beside = (seen_px - centre_px) / scale_px
    return np.array([beside[1], -beside[0]])


def _scales(tilt: FloatArray) -> FloatArray:
    """Scales (2,) of the image along u and v on the optical axis, relative to a sensor without tilt."""
    return np.asarray(tilt.diagonal()[:2] / tilt[2, 2], dtype=np.float64)


def _tilt_matrix(tilt_rad: FloatArray) -> FloatArray:
    """Homography (3, 3) of a tilted sensor, as in OpenCV; the identity without tilt."""
    if not len(tilt_rad):
        return np.eye(3)
    (cos_x, cos_y), (sin_x, sin_y) = np.cos(tilt_rad), np.sin(tilt_rad)
    about_x = np.array([[1, 0, 0], [0, cos_x, sin_x], [0, -sin_x, cos_x]])
    about_y = np.array([[cos_y, 0, -sin_y], [0, 1, 0], [sin_y, 0, cos_y]])
    turn = about_y @ about_x
    onto_sensor = np.array([[turn[2, 2], 0, -turn[0, 2]], [0, turn[2, 2], -turn[1, 2]], [0, 0, 1]])
    return np.asarray(onto_sensor @ turn, dtype=np.float64)


def _to_axis(unit: FloatArray) -> FloatArray:
    """The smallest rotation (3, 3) that brings a unit vector onto the third axis."""
    x, y, z = unit
    across = np.array([[0, 0, -x], [0, 0, -y], [x, y, 0]])
    return np.asarray(np.eye(3) + across + across @ across / (1 + z), dtype=np.float64)


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / np.linalg.norm(vector), dtype=np.float64)
