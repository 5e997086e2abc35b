"""Are lengths what they are said to be? A wrong pitch, or another unit, fits as well as the right one."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

import numpy as np
from scipy.optimize import minimize_scalar

from processing.calibration.calibration import Model, ViewCalibration
from processing.calibration.fit.placement import OBLIQUE_DEG, line_angle_deg, sight_azimuth_deg
from processing.calibration.fit.shear_check import check_shear
from processing.calibration.observation import CalibrationSet
from processing.calibration.triangulation import linearise
from processing.calibration.verdict import Doubt
from processing.geometry import FloatArray, PinholeCamera, ViewMapping

MAX_STRETCH = 1.1
"""Pixels are square; a sensor tilted by 24 deg looks like one of pixels of 1.095 to a model without tilt."""
MAX_TILTED_STRETCH = 1.03
"""Where the model has a tilt of its own, less is left to it."""
SCALE_TOLERANCE = 0.1
"""Magnifications of lenses are known to a tenth, or better."""
USUAL_PX_PER_MM = (0.2, 250.0)
"""Scales beyond are those of rooms and microscopes, or of metres, inches and micrometres that count as mm."""
NEAREST_MM = 5.0
"""No lens stands closer to what it sees, with room for another beside it."""
LENGTHENED = 0.015
"""Shapes of pixels tell a length of z that is wrong by more."""
SQUARE = 0.003
"""How square pixels are once it is right; a fit knows them to a thousandth."""
NOT_SQUARE, LEAST_VIEWS = 0.006, 3
"""From so much on a wider target, or a stage that moves askew, is looked for, where so many views tell."""
EXPLAINED = 0.15
"""Of what is not square, which may then be left; of what tilted sensors make, nine tenths are."""
NEARER = 0.6
"""By this factor must azimuths then come nearer to those of the rig: a sensor's tilt looks like a longer z, and brings
them no nearer."""


def scale_px_per_mm(mapping: ViewMapping, point_mm: FloatArray) -> float:
    """Image scale at a point (3,), across the line of sight: the mean of both directions."""
    ((along_u, along_v),) = linearise(mapping, point_mm[None])[1]
    return float(np.sqrt(np.linalg.norm(np.cross(along_u, along_v))))


def check_scales(calibration_set: CalibrationSet, views: Mapping[str, ViewCalibration]) -> Iterator[Doubt]:
    """What speaks against the lengths that views were fitted to."""
    scales_px_per_mm = {name: scale_px_per_mm(view.mapping, calibration_set.middle_mm) for name, view in views.items()}
    yield from _other_scales(scales_px_per_mm, calibration_set.scales_px_per_mm)
    if not calibration_set.unit_stated and not calibration_set.scales_px_per_mm:
        yield from _unusual(calibration_set, views, scales_px_per_mm)
    yield from _stretched(views)
    mappings = {name: view.mapping for name, view in views.items()}
    yield from _longer(calibration_set, mappings)
    yield from _askew(mappings)
    yield from check_shear(mappings)


def _other_scales(found_px_per_mm: Mapping[str, float], said_px_per_mm: Mapping[str, float]) -> Iterator[Doubt]:
    for name, said in said_px_per_mm.items():
        ratio = found_px_per_mm[name] / said
        if not 1 / (1 + SCALE_TOLERANCE) < ratio < 1 + SCALE_TOLERANCE:
            yield Doubt(
                (name,),
                f"{name}: {found_px_per_mm[name]:.4g} px/mm by the target, {said:.4g} px/mm by the rig, "
                f"{ratio:.3g} times as much: are pitch_mm, z_mm and their unit right?",
            )


def _unusual(
    calibration_set: CalibrationSet, views: Mapping[str, ViewCalibration], found_px_per_mm: Mapping[str, float]
) -> Iterator[Doubt]:
    """Questions about scales and distances that are more likely those of another unit."""
    least, most = USUAL_PX_PER_MM
    for name, view in views.items():
        mapping = view.mapping
        away_mm = (
            float(np.linalg.norm(mapping.centre_mm - calibration_set.middle_mm))
            if isinstance(mapping, PinholeCamera)
            else np.inf
        )
        if not least < found_px_per_mm[name] < most or away_mm < NEAREST_MM:
            stands = f", {away_mm:.3g} mm from the target" if np.isfinite(away_mm) else ""
            yield Doubt(
                (name,),
                f"{name}: {found_px_per_mm[name]:.4g} px/mm{stands}: are lengths in mm? Say unit or scale_px_per_mm",
            )


def _stretched(views: Mapping[str, ViewCalibration]) -> Iterator[Doubt]:
    """Pixels that are not square: a wrong pitch, or a wrong scale of the stage, fits as well as the right."""
    for name, view in views.items():
        if isinstance(view.mapping, PinholeCamera):
            most = MAX_TILTED_STRETCH if view.model is Model.PINHOLE_TILTED else MAX_STRETCH
            height_to_width = float(view.mapping.camera_matrix[0, 0] / view.mapping.camera_matrix[1, 1])
            if not 1 / most < height_to_width < most:
                yield Doubt(
                    (name,),
                    f"{name}: its pixels seem {height_to_width:.2f} times as high as wide: is pitch_mm of the target "
                    f"right, and the position of its planes in mm?",
                )


def _longer(calibration_set: CalibrationSet, mappings: Mapping[str, ViewMapping]) -> Iterator[Doubt]:
    """One length of z for which all pixels are square, and views stand where the rig says."""
    said_deg = calibration_set.azimuths_deg
    cameras = {name: each for name, each in mappings.items() if isinstance(each, PinholeCamera) and name in said_deg}
    if not steps_are_told(said_deg[name] for name in cameras):
        return
    longer, uneven = _best(_longer_z, (0.7, 1.4), list(cameras.values()))
    stands_deg = np.array([sight_azimuth_deg(camera, calibration_set.middle_mm) for camera in cameras.values()])
    beside_deg = stands_deg - np.array([said_deg[name] for name in cameras])
    then_deg = beside_deg - stands_deg + np.rad2deg(np.arctan2(np.tan(np.deg2rad(stands_deg)), longer))
    apart_deg, then_apart_deg = (float(np.std((angles + 90) % 180)) for angles in (beside_deg, then_deg))
    if abs(longer - 1) < LENGTHENED or uneven > SQUARE or then_apart_deg > NEARER * apart_deg:
        return
    pitch = calibration_set.target and f"pitch_mm {calibration_set.target.pitch_mm / longer:.3g}"
    yield Doubt(
        tuple(cameras),
        f"if z were {longer:.3g} times as long, all pixels would be square, and azimuths {then_apart_deg:.1f} deg "
        f"beside those of the rig, not {apart_deg:.1f}: is the step of the stage right, or is it {pitch or 'x and y'}?",
    )


def steps_are_told(azimuths_deg: Iterable[float]) -> bool:
    """Whether views that were said to stand there tell a length of z: two oblique ones do."""
    oblique = [OBLIQUE_DEG < line_angle_deg(angle) < 90 - OBLIQUE_DEG for angle in azimuths_deg]
    return bool(np.sum(oblique) >= 2)


def _askew(mappings: Mapping[str, ViewMapping]) -> Iterator[Doubt]:
    """A target that is wider than it was said to be, or a stage that moves askew, if it makes all pixels square.

    A tilted sensor looks like neither: it changes the pixels of oblique views most, and those on both sides alike.
    """
    cameras = {name: each for name, each in mappings.items() if isinstance(each, PinholeCamera)}
    if len(cameras) < LEAST_VIEWS or (before := _unevenness(np.eye(3), list(cameras.values()))) < NOT_SQUARE:
        return
    enough = max(SQUARE, EXPLAINED * before)
    wider, uneven = _best(_wider, (0.7, 1.4), list(cameras.values()))
    if uneven <= enough:
        yield Doubt(
            tuple(cameras),
            f"if x were {wider:.3g} times as long, all pixels would be square: is the target as wide as it is said to "
            "be, or was its print scaled?",
        )
    askew, uneven = _best(_oblique, (-0.3, 0.3), list(cameras.values()))
    if uneven <= enough:
        yield Doubt(
            tuple(cameras),
            f"if the stage moved {np.rad2deg(np.arctan(askew)):.1f} deg askew towards x, all pixels would be square: "
            "is its travel square to the target?",
        )


def _wider(factor: float) -> FloatArray:
    return np.diag([factor, 1.0, 1.0])


def _longer_z(factor: float) -> FloatArray:
    return np.diag([1.0, 1.0, factor])


def _oblique(slope: float) -> FloatArray:
    return np.array([[1.0, 0.0, slope], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


def _best(
    true_of_said: Callable[[float], FloatArray], bounds: tuple[float, float], cameras: Sequence[PinholeCamera]
) -> tuple[float, float]:
    """The change of lengths with which the pixels of all cameras are as square as can be, and what is left."""
    found = minimize_scalar(lambda change: _unevenness(true_of_said(change), cameras), bounds=bounds, method="bounded")
    return float(found.x), float(found.fun)


def _unevenness(true_of_said: FloatArray, cameras: Sequence[PinholeCamera]) -> float:
    """Root mean square of ln(height / width) of pixels if lengths (3,) are truly ``true_of_said`` times those said.

    A camera ``K R`` of the lengths that were said is ``K R`` times the inverse of that matrix for the true ones; its
    focal lengths in pixels are ``|m1 x m3|`` and ``|m2 x m3|`` over ``|m3|^2``, with the rows of the product.
    """
    said_of_true = np.linalg.inv(true_of_said)
    rows = [camera.camera_matrix @ camera.rotation @ said_of_true for camera in cameras]
    shapes = [np.linalg.norm(np.cross(m1, m3)) / np.linalg.norm(np.cross(m2, m3)) for m1, m2, m3 in rows]
    return float(np.sqrt(np.mean(np.log(shapes) ** 2)))
