"""What calibration starts from: points with known places, and where each view sees them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from processing.calibration.target.targets import Target
from processing.geometry import FloatArray


@dataclass(frozen=True, eq=False)
class PlaneObservation:
    """Points of one target position as one view sees them.

    Parameters
    ----------
    name : str
        Name of the image, the board or the level; errors and reports use it.
    points_mm : (N, 3) array
        Where the points are, in world coordinates; on the board (z = 0) where its pose is free.
    image_px : (N, 2) array
        Where they are seen (u, v).
    z_mm : float | None
        Position of the plane; None for scattered points and for boards in a free pose.
    free_pose : bool
        Nobody knows where the board stood; the fit finds it.
    """

    name: str
    points_mm: FloatArray
    image_px: FloatArray
    z_mm: float | None = None
    free_pose: bool = False

    def __len__(self) -> int:
        return len(self.points_mm)

    def select(self, chosen: NDArray[np.bool_]) -> "PlaneObservation":
        """Some of the points."""
        return PlaneObservation(self.name, self.points_mm[chosen], self.image_px[chosen], self.z_mm, self.free_pose)


@dataclass(frozen=True)
class ViewObservations:
    """All that one view sees of the target.

    Parameters
    ----------
    image_size_px : tuple[int, int]
        (width, height).
    planes : tuple[PlaneObservation, ...]
        At least one; in order of z where that is known.
    """

    image_size_px: tuple[int, int]
    planes: tuple[PlaneObservation, ...]

    @property
    def free_pose(self) -> bool:
        """The boards stood anywhere: only the intrinsics of the camera can be found."""
        return any(plane.free_pose for plane in self.planes)


@dataclass(frozen=True)
class CalibrationSet:
    """Detected points of all views.

    Parameters
    ----------
    source : str
        Run id or name of the imported set.
    target : Target | None
        None where points were measured elsewhere.
    views : Mapping[str, ViewObservations]
        By view name.
    notes : tuple[str, ...]
        What was left out, and why; one line each.
    azimuths_deg : Mapping[str, float]
        Where the rig says that views stand; the fit is checked against it.
    rolls_deg : Mapping[str, float]
        How cameras were said to be turned about their axes; the others count as upright.
    mirrored : tuple[str, ...]
        Views that are said to look by a mirror: their images are flipped, their lines of sight are not.
    scales_px_per_mm : Mapping[str, float]
        Scale of views in the middle of the target, as it was stated or as the rig's magnification gives it.
    unit_stated : bool
        Somebody said what lengths are in.
    unplaced_pixels : tuple[str, ...]
        Views of measured points of which nobody said where u and v count from.
    """

    source: str
    target: Target | None
    views: Mapping[str, ViewObservations]
    notes: tuple[str, ...] = ()
    azimuths_deg: Mapping[str, float] = field(default_factory=dict)
    rolls_deg: Mapping[str, float] = field(default_factory=dict)
    mirrored: tuple[str, ...] = ()
    scales_px_per_mm: Mapping[str, float] = field(default_factory=dict)
    unit_stated: bool = False
    unplaced_pixels: tuple[str, ...] = ()

    @property
    def middle_mm(self) -> FloatArray:
        """Middle (3,) of the points of all views."""
        middles_mm = [stacked(seen.planes)[0].mean(axis=0) for seen in self.views.values()]
        return np.asarray(np.mean(middles_mm, axis=0), dtype=np.float64)


def stacked(planes: Sequence[PlaneObservation]) -> tuple[FloatArray, FloatArray]:
    """World points (N, 3) in mm and image points (N, 2) in px of several planes."""
    return np.concatenate([plane.points_mm for plane in planes]), np.concatenate([plane.image_px for plane in planes])
