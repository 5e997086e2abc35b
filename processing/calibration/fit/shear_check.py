"""Is y as long as it is said to be, and square to x and z? What is not fits nearly as well, and shears all volumes.

A fit has no pixels whose rows and columns meet at another angle than a right one. Where points ask for them, it moves
the axis of the lens far beside the image instead. So pixels are looked at in the middle of the image, through which the
axis of every lens goes, nearly.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial

import numpy as np
from scipy.optimize import minimize_scalar

from processing.calibration.fit.placement import OBLIQUE_DEG
from processing.calibration.triangulation import linearise
from processing.calibration.verdict import Doubt
from processing.geometry import FloatArray, PinholeCamera, ViewMapping

NOT_SQUARE, LEAST_VIEWS = 0.006, 3
"""From so much on it is looked for, where so many views tell."""
SQUARE, EXPLAINED = 0.0015, 0.15
"""What may then be left, and of what there was; axes that miss the middle by a twentieth of the width leave as much."""
_SLOPES, _FACTORS = (-0.3, 0.3), (0.7, 1.4)


def check_shear(mappings: Mapping[str, ViewMapping]) -> Iterator[Doubt]:
    """A stage that moves askew towards y, and a target that is not as high, or not as square, as it was said to be.

    Sensors that are all tilted alike look like the latter two; views of several obliquities are not tilted alike.
    """
    cameras = {name: each for name, each in mappings.items() if isinstance(each, PinholeCamera)}
    slopes = [_slopes_at_the_middle(camera) for camera in cameras.values()]
    if len(cameras) < LEAST_VIEWS or (before := _off_square(np.eye(3), slopes)) < NOT_SQUARE:
        return
    enough = max(SQUARE, EXPLAINED * before)
    askew, left = _best(partial(_sheared, along=1, across=2), _SLOPES, slopes)
    if left <= enough:
        yield Doubt(
            tuple(cameras),
            f"if the stage moved {_degrees(askew):.1f} deg askew towards y, all pixels would be square: is its travel "
            "square to the target?",
        )
    if _equally_oblique(list(cameras.values())):
        return
    taller, left = _best(_taller, _FACTORS, slopes)
    if left <= enough:
        yield Doubt(
            tuple(cameras),
            f"if y were {taller:.3g} times as long, all pixels would be square: is the target as high as it is said to "
            "be, or was its print scaled?",
        )
    slanting, left = _best(partial(_sheared, along=0, across=1), _SLOPES, slopes)
    if left <= enough:
        yield Doubt(
            tuple(cameras),
            f"if columns of the target slanted by {_degrees(slanting):.1f} deg, all pixels would be square: are its "
            "rows and columns square to each other?",
        )


def _best(
    true_of_said: Callable[[float], FloatArray], bounds: tuple[float, float], slopes: Sequence[FloatArray]
) -> tuple[float, float]:
    """The change of lengths with which the pixels of all cameras are as square as can be, and what is left."""
    found = minimize_scalar(lambda change: _off_square(true_of_said(change), slopes), bounds=bounds, method="bounded")
    return float(found.x), float(found.fun)


def _taller(factor: float) -> FloatArray:
    return np.diag([1.0, factor, 1.0])


def _sheared(slope: float, *, along: int, across: int) -> FloatArray:
    sheared = np.eye(3)
    sheared[along, across] = slope
    return sheared


def _degrees(slope: float) -> float:
    return float(np.rad2deg(np.arctan(slope)))


def _slopes_at_the_middle(camera: PinholeCamera) -> FloatArray:
    """Gradients (2, 3) of u and v, where the middle of the image is seen."""
    middle_px = (np.array([camera.image_size_px]) - 1) / 2
    return np.asarray(linearise(camera, camera.back_project(middle_px, 0.0))[1][0], dtype=np.float64)


def _off_square(true_of_said: FloatArray, slopes: Sequence[FloatArray]) -> float:
    """Root mean square of ln(height / width) of pixels and of the angle that their sides lack to a right one."""
    of_true = np.array(slopes) @ np.linalg.inv(true_of_said)
    lengths = np.linalg.norm(of_true, axis=2)
    stretched = np.log(lengths[:, 0] / lengths[:, 1])
    slanted = (of_true[:, 0] * of_true[:, 1]).sum(axis=1) / lengths.prod(axis=1)
    return float(np.sqrt(np.mean(stretched**2 + slanted**2)))


def _equally_oblique(cameras: Sequence[PinholeCamera]) -> bool:
    """Whether all lines of sight have the same angle to z, within ``OBLIQUE_DEG``."""
    angles_deg = np.rad2deg(np.arccos([abs(camera.rotation[2, 2]) for camera in cameras]))
    return bool(np.ptp(angles_deg) < OBLIQUE_DEG)
