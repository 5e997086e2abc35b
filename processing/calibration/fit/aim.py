"""Aim: a camera told by what its image shows, in parameters that hardly depend on each other.

Seen from afar, focal length and distance, principal point and rotation, rotation and tilt of the sensor change the
image in almost the same way. A fit of these walks along narrow curved valleys and stops half-way. Where the middle
of the target is seen, how large, from which direction and how obliquely is plain from the image; in these values
the same fit takes a handful of steps.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from processing.geometry import FloatArray, rotation_vector_of, tilt_matrix

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
        tilt = _tilt(tilt_rad)
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
        """Parameters (..., 15) or (..., 17) of the cameras that show this."""
        distance_mm = values[..., 3:4] * self.distance_mm
        seen_px, centre_px = values[..., 4:6] * _KILO_PX, values[..., _CENTRE] * _KILO_PX
        scale_px, oblique = values[..., 6:8] * distance_mm, values[..., _TILT]
        tilt_rad = oblique - _obliquity(seen_px, centre_px, scale_px)[..., : oblique.shape[-1]]
        tilt = _tilt(tilt_rad)
        focal_px = scale_px / _scales(tilt)
        on_sensor = _with_one((seen_px - centre_px) / focal_px)[..., None]
        ray = _unit(np.asarray(np.linalg.solve(tilt, on_sensor)[..., 0], dtype=np.float64))
        turned = _about_axis(values[..., 2]) @ _to_axis(_unit(_with_one(values[..., :2]))) @ self.frame
        rotation = _to_axis(ray).swapaxes(-1, -2) @ turned
        translation_mm = distance_mm * ray - rotation @ self.middle_mm
        turn = np.reshape([rotation_vector_of(one) for one in rotation.reshape(-1, 3, 3)], ray.shape)
        return np.concatenate([turn, translation_mm, focal_px, centre_px, values[..., _LENS], tilt_rad], axis=-1)

    def linearised(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The parameters (P,), and their derivatives (P, P) by the values."""
        change = np.eye(len(values))
        moved = [*range(_LENS.start), *range(_LENS.stop, len(values))]
        here, *ahead = self.parameters(values + _STEP * np.vstack([np.zeros(len(values)), change[moved]]))
        change[:, moved] = (np.array(ahead) - here).T / _STEP
        return here, change

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
    """Angles (..., 2) at which a line of sight beside the optical axis meets the sensor, as tilts of OpenCV's sense."""
    return np.asarray(((seen_px - centre_px) / scale_px)[..., ::-1] * [1.0, -1.0])


def _scales(tilt: FloatArray) -> FloatArray:
    """Scales (..., 2) of the image along u and v on the optical axis, relative to a sensor without tilt."""
    return np.asarray(tilt.diagonal(axis1=-2, axis2=-1)[..., :2] / tilt[..., 2:, 2], dtype=np.float64)


def _tilt(tilt_rad: FloatArray) -> FloatArray:
    """Homographies (..., 3, 3) of sensors tilted by (..., 2); the identity without tilt, (..., 0)."""
    return tilt_matrix(tilt_rad) if tilt_rad.shape[-1] else np.broadcast_to(np.eye(3), (*tilt_rad.shape[:-1], 3, 3))


def _to_axis(unit: FloatArray) -> FloatArray:
    """The smallest rotations (..., 3, 3) that bring unit vectors (..., 3) onto the third axis."""
    across = np.zeros((*unit.shape, 3))
    across[..., :2, 2], across[..., 2, :2] = -unit[..., :2], unit[..., :2]
    return np.asarray(np.eye(3) + across + across @ across / (1 + unit[..., 2, None, None]), dtype=np.float64)


def _about_axis(angle_rad: FloatArray) -> FloatArray:
    """Rotations (..., 3, 3) by angles (...) around the third axis."""
    rotation = np.zeros((*angle_rad.shape, 3, 3))
    rotation[..., 0, 0] = rotation[..., 1, 1] = np.cos(angle_rad)
    rotation[..., 1, 0], rotation[..., 0, 1], rotation[..., 2, 2] = np.sin(angle_rad), -np.sin(angle_rad), 1.0
    return rotation


def _with_one(vectors: FloatArray) -> FloatArray:
    """Vectors (..., 2) with a third element of 1."""
    return np.concatenate([vectors, np.ones((*vectors.shape[:-1], 1))], axis=-1)


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True), dtype=np.float64)
