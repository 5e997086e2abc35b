"""Where views stand, and whether that can be: a camera that hangs upside down sees the target's axes turned.

A target that looks the same from both ways up is labelled by how it lies in the image. Turned with its camera by half a
turn about z, or seen by a mirror, it gives a calibration that fits as well as any other, of a camera on the mirrored
side; lines of sight of the other views then never meet its own. Nothing in one view's points tells. What tells is where
the rig says that the camera stands; or that two cameras seem to stand in one place.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from processing.calibration.triangulation import linearise
from processing.geometry import FloatArray, PinholeCamera, ViewMapping, rotation_from_angles

TURNS_DEG = (0, 180, 90, -90)
"""How labels may be turned about z, the likely ones first."""
CLEARER_DEG = 5.0
"""A turned view must agree by so much better with the rig's azimuth than one that is not."""
DOUBTFUL_DEG = 3.0
"""Views that disagree with the rig's azimuth by more, however they are turned, are doubted: so well it is known."""
OBLIQUE_DEG = 10.0
"""Only views beyond show by their azimuth that x and z are not in one unit."""
SAME_STRETCH = 0.03
"""Views whose azimuths ask for the same stretch of x, to this part, have the pitch wrong, or the positions."""
SAME_PLACE_DEG, SAME_PLACE = 5.0, 0.1
"""Cameras whose lines of sight and places, relative to their distance, differ by less stand in each other's way."""


@dataclass(frozen=True)
class Placement:
    """Where a view stands and how it is turned, in the angles of ``rotation_from_angles``.

    Parameters
    ----------
    azimuth_deg, pitch_deg : float
        Of its line of sight through the middle of the target.
    roll_deg : float
        Around that line; of a mirrored view that of its image flipped left to right.
    centre_mm : tuple[float, float, float] | None
        Centre of projection; None for mappings that have none.
    """

    azimuth_deg: float
    pitch_deg: float
    roll_deg: float
    centre_mm: tuple[float, float, float] | None


def placement(mapping: ViewMapping, middle_mm: FloatArray) -> Placement:
    """Where a view of any kind stands, by its line of sight through a point (3,)."""
    direction, to_right = _axes(mapping, middle_mm)
    azimuth_rad, pitch_rad = np.deg2rad(_azimuth_deg(direction)), np.arcsin(np.clip(-direction[1], -1, 1))
    across, down, _ = rotation_from_angles(azimuth_rad, pitch_rad)
    roll_rad = np.arctan2(to_right @ down, to_right @ across)
    azimuth_deg, pitch_deg, roll_deg = (float(np.rad2deg(angle)) for angle in (azimuth_rad, pitch_rad, roll_rad))
    centre_mm = tuple(mapping.centre_mm.tolist()) if isinstance(mapping, PinholeCamera) else None
    return Placement(azimuth_deg, pitch_deg, roll_deg, centre_mm)


def turned_views(
    mappings: Mapping[str, ViewMapping], middle_mm: FloatArray, azimuths_deg: Mapping[str, float]
) -> dict[str, int]:
    """Views that agree with the rig only if their labels are turned about z, and by how many degrees.

    Azimuths count modulo half a turn and up to a common offset: the target may stand askew in the rig.

    Parameters
    ----------
    mappings : Mapping[str, ViewMapping]
        Fitted views.
    middle_mm : (3,) array
        A point in the middle of the target.
    azimuths_deg : Mapping[str, float]
        Where the rig says that views stand; not necessarily all of them.
    """
    views = [name for name in mappings if name in azimuths_deg]
    off_deg = _disagreements_deg(mappings, middle_mm, azimuths_deg)
    best = {name: int(np.argmin(off_deg[name] + CLEARER_DEG * (np.arange(len(TURNS_DEG)) > 0))) for name in views}
    return {name: TURNS_DEG[turn] for name, turn in best.items() if turn}


def exchanged_views(
    mappings: Mapping[str, ViewMapping], middle_mm: FloatArray, azimuths_deg: Mapping[str, float]
) -> dict[str, str]:
    """By view: in whose place of the rig it stands; all views then agree with the rig, none of them turned.

    All orders are considered. Empty where none agrees, or the views stand in their own places.
    """
    names = [name for name in mappings if name in azimuths_deg]
    stands_deg = np.array([sight_azimuth_deg(mappings[name], middle_mm) for name in names])
    beside_deg = stands_deg[:, None] - np.array([azimuths_deg[name] for name in names])
    orders = [_best_order(beside_deg, offset_deg) for offset_deg in (0.0, *beside_deg.ravel())]
    order, left_deg = min(orders, key=lambda found: float(found[1].sum()), default=(np.arange(0), np.zeros(0)))
    if left_deg.max(initial=0.0) > DOUBTFUL_DEG:
        return {}
    return {name: names[place] for name, place in zip(names, order, strict=True) if names[place] != name}


def common_stretch(
    mappings: Mapping[str, ViewMapping], middle_mm: FloatArray, azimuths_deg: Mapping[str, float]
) -> float | None:
    """By what x must be stretched against z for oblique views to stand where the rig says; None unless all agree."""
    stretches = [
        float(np.tan(np.deg2rad(said_deg)) / np.tan(np.deg2rad(sight_azimuth_deg(mappings[name], middle_mm))))
        for name, said_deg in azimuths_deg.items()
        if name in mappings and OBLIQUE_DEG < line_angle_deg(said_deg) < 90 - OBLIQUE_DEG
    ]
    if len(stretches) < 2 or max(stretches) > (1 + SAME_STRETCH) * min(stretches) or min(stretches) <= 0:
        return None
    return float(np.mean(stretches))


def doubtful_views(
    mappings: Mapping[str, ViewMapping], middle_mm: FloatArray, azimuths_deg: Mapping[str, float]
) -> dict[str, float]:
    """Views that no turn brings near the rig's azimuth, and the degrees that are left."""
    off_deg = _disagreements_deg(mappings, middle_mm, azimuths_deg)
    return {name: float(angles.min()) for name, angles in off_deg.items() if angles.min() > DOUBTFUL_DEG}


def opposite_views(
    mappings: Mapping[str, ViewMapping], middle_mm: FloatArray, azimuths_deg: Mapping[str, float]
) -> list[str]:
    """Cameras whose lines of sight agree with the rig's azimuths, but run the other way than those of most others."""
    beside_rad = {
        name: np.deg2rad(sight_azimuth_deg(mapping, middle_mm) - azimuths_deg[name])
        for name, mapping in mappings.items()
        if name in azimuths_deg and isinstance(mapping, PinholeCamera)
    }
    alike = {name: np.cos(beside - next(iter(beside_rad.values()))) > 0 for name, beside in beside_rad.items()}
    fewer = 2 * sum(alike.values()) <= len(alike)
    return [name for name, same in alike.items() if same == fewer]


def same_either_way(
    mappings: Mapping[str, ViewMapping], middle_mm: FloatArray, turned_deg: Mapping[str, int]
) -> list[str]:
    """Views of which no azimuth tells whether they are turned as others are: those near 0 or 90 degrees."""
    turns = sorted({TURNS_DEG.index(turn) for turn in turned_deg.values()})
    undecided = []
    for name, mapping in mappings.items():
        azimuths_deg = _turned_azimuths_deg(_axes(mapping, middle_mm)[0])
        if name not in turned_deg and (line_angle_deg(azimuths_deg[turns] - azimuths_deg[0]) < CLEARER_DEG).any():
            undecided.append(name)
    return undecided


def in_one_place(mappings: Mapping[str, ViewMapping], middle_mm: FloatArray) -> Iterator[tuple[str, str]]:
    """Pairs of pinhole cameras that seem to stand in each other's way."""
    cameras = {name: mapping for name, mapping in mappings.items() if isinstance(mapping, PinholeCamera)}
    for (one, first), (other, second) in combinations(cameras.items(), 2):
        away_mm = [camera.centre_mm - middle_mm for camera in (first, second)]
        distances_mm = np.linalg.norm(away_mm, axis=1)
        cosine = float(np.dot(*away_mm) / distances_mm.prod())
        apart_mm = float(np.linalg.norm(away_mm[0] - away_mm[1]))
        if cosine > np.cos(np.deg2rad(SAME_PLACE_DEG)) and apart_mm < SAME_PLACE * distances_mm.max():
            yield one, other


def sight_azimuth_deg(mapping: ViewMapping, middle_mm: FloatArray) -> float:
    """Azimuth of a view's line of sight through a point (3,)."""
    return _azimuth_deg(_axes(mapping, middle_mm)[0])


def line_angle_deg(angles_deg: FloatArray | float) -> FloatArray:
    """Angles between lines, which have no direction: 0 to 90 degrees."""
    return np.abs((np.asarray(angles_deg, dtype=np.float64) + 90) % 180 - 90)


def _axes(mapping: ViewMapping, middle_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit vectors (3,) along the line of sight, away from a camera, and to the right of who looks along it.

    The right is where u grows, but in a mirrored image. A mapping without a centre counts as one that is not mirrored.
    """
    ((to_right, downwards),) = linearise(mapping, middle_mm[None])[1]
    direction = np.cross(to_right, downwards)
    if isinstance(mapping, PinholeCamera) and direction @ (middle_mm - mapping.centre_mm) < 0:
        direction, to_right = -direction, -to_right
    return direction / np.linalg.norm(direction), to_right / np.linalg.norm(to_right)


def _azimuth_deg(direction: FloatArray) -> float:
    return float(np.rad2deg(np.arctan2(direction[0], direction[2])))


def _best_order(beside_deg: FloatArray, offset_deg: float) -> tuple[NDArray[np.intp], FloatArray]:
    """Which place of the rig (N,) suits each view best, one each, and by how much the views (N,) miss them."""
    off_deg = line_angle_deg(beside_deg - offset_deg)
    views, places = linear_sum_assignment(off_deg)
    return places, off_deg[views, places]


def _disagreements_deg(
    mappings: Mapping[str, ViewMapping], middle_mm: FloatArray, azimuths_deg: Mapping[str, float]
) -> dict[str, FloatArray]:
    """By view: angles (turns,) between the azimuth of every turn and the rig's, for the likeliest common offset."""
    beside_deg = {
        name: _turned_azimuths_deg(_axes(mapping, middle_mm)[0]) - azimuths_deg[name]
        for name, mapping in mappings.items()
        if name in azimuths_deg
    }
    offsets_deg = [0.0, *(float(angles[0]) for angles in beside_deg.values())]
    likeliest_deg = min(offsets_deg, key=lambda offset_deg: _cost_deg(list(beside_deg.values()), offset_deg))
    return {name: line_angle_deg(angles - likeliest_deg) for name, angles in beside_deg.items()}


def _turned_azimuths_deg(direction: FloatArray) -> FloatArray:
    """Azimuths (turns,) of a line of sight (3,) that is turned about z."""
    x, y, z = direction
    turns_rad = np.deg2rad(TURNS_DEG)
    return np.asarray(np.rad2deg(np.arctan2(x * np.cos(turns_rad) - y * np.sin(turns_rad), z)), dtype=np.float64)


def _cost_deg(beside_deg: Sequence[FloatArray], offset_deg: float) -> float:
    dearer_deg = CLEARER_DEG * (np.arange(len(TURNS_DEG)) > 0)
    return sum(float((line_angle_deg(angles - offset_deg) + dearer_deg).min()) for angles in beside_deg)
