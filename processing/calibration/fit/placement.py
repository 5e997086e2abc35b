"""Where views stand, and whether that can be: a camera that hangs upside down sees the target's axes turned.

A target that looks the same from both ways up is labelled by how it lies in the image. Turned with its camera by half a
turn about z, it gives a calibration that fits as well as any other, of a camera on the mirrored side; lines of sight of
the other views then never meet its own. Nothing in one view's points tells. What tells is where the rig says that the
camera stands; or that two cameras seem to stand in one place.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from processing.calibration.triangulation import linearise
from processing.geometry import FloatArray, PinholeCamera, ViewMapping, rotation_from_angles

TURNS_DEG = (0, 180, 90, -90)
"""How labels may be turned about z, the likely ones first."""
CLEARER_DEG = 5.0
"""A turned view must agree by so much better with the rig's azimuth than one that is not."""
DOUBTFUL_DEG = 20.0
"""Views that disagree with the rig's azimuth by more, however they are turned, are noted."""
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
        Around that line.
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
    azimuth_rad, pitch_rad = np.arctan2(direction[0], direction[2]), np.arcsin(np.clip(-direction[1], -1, 1))
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
) -> Iterator[tuple[str, str]]:
    """Pairs of views that need only change places in the rig for all views to agree with it, none of them turned."""
    for one, other in combinations([name for name in mappings if name in azimuths_deg], 2):
        exchanged_deg = {**azimuths_deg, one: azimuths_deg[other], other: azimuths_deg[one]}
        off_deg = _disagreements_deg(mappings, middle_mm, exchanged_deg)
        if all(angles[0] < CLEARER_DEG for angles in off_deg.values()):
            yield one, other


def doubtful_views(
    mappings: Mapping[str, ViewMapping], middle_mm: FloatArray, azimuths_deg: Mapping[str, float]
) -> dict[str, float]:
    """Views that no turn brings near the rig's azimuth, and the degrees that are left."""
    off_deg = _disagreements_deg(mappings, middle_mm, azimuths_deg)
    return {name: float(angles.min()) for name, angles in off_deg.items() if angles.min() > DOUBTFUL_DEG}


def same_either_way(
    mappings: Mapping[str, ViewMapping], middle_mm: FloatArray, turned_deg: Mapping[str, int]
) -> list[str]:
    """Views of which no azimuth tells whether they are turned as others are: those near 0 or 90 degrees."""
    turns = sorted({TURNS_DEG.index(turn) for turn in turned_deg.values()})
    undecided = []
    for name, mapping in mappings.items():
        azimuths_deg = _turned_azimuths_deg(_axes(mapping, middle_mm)[0])
        if name not in turned_deg and (_line_angle_deg(azimuths_deg[turns] - azimuths_deg[0]) < CLEARER_DEG).any():
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


def _axes(mapping: ViewMapping, middle_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit vectors (3,) along the line of sight, and towards growing u across it."""
    ((to_right, downwards),) = linearise(mapping, middle_mm[None])[1]
    direction = np.cross(to_right, downwards)
    return direction / np.linalg.norm(direction), to_right / np.linalg.norm(to_right)


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
    return {name: _line_angle_deg(angles - likeliest_deg) for name, angles in beside_deg.items()}


def _turned_azimuths_deg(direction: FloatArray) -> FloatArray:
    """Azimuths (turns,) of a line of sight (3,) that is turned about z."""
    x, y, z = direction
    turns_rad = np.deg2rad(TURNS_DEG)
    return np.asarray(np.rad2deg(np.arctan2(x * np.cos(turns_rad) - y * np.sin(turns_rad), z)), dtype=np.float64)


def _cost_deg(beside_deg: Sequence[FloatArray], offset_deg: float) -> float:
    dearer_deg = CLEARER_DEG * (np.arange(len(TURNS_DEG)) > 0)
    return sum(float((_line_angle_deg(angles - offset_deg) + dearer_deg).min()) for angles in beside_deg)


def _line_angle_deg(angles_deg: FloatArray) -> FloatArray:
    """Angles between lines, which have no direction: 0 to 90 degrees."""
    return np.abs((angles_deg + 90) % 180 - 90)
