"""SprayAxis: where a spray comes from and where it goes, and droplets in its coordinates."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from processing.geometry import FloatArray

LEAST_FORWARDS = 0.2
"""Cosine from the axis of a direction that leads back to the nozzle."""
LATTICE = 48
"""Points of a box along its longest edge, to say which part of a cell lies in it."""


@dataclass(frozen=True)
class SprayAxis:
    """The axis of a spray.

    Parameters
    ----------
    nozzle_mm : tuple of 3 float
        Middle of the orifice.
    direction : tuple of 3 float
        In which the spray leaves, of any length.
    """

    nozzle_mm: tuple[float, float, float]
    direction: tuple[float, float, float]

    def __post_init__(self) -> None:
        if not np.isfinite([self.nozzle_mm, self.direction]).all() or not any(self.direction):
            raise ValueError(f"a spray needs a nozzle and a direction: {self.nozzle_mm} mm, {self.direction}")

    @property
    def frame(self) -> FloatArray:
        """Rows: the axis, and two directions across; the first as near to x as can be, of an axis along x to z."""
        axis = np.array(self.direction) / np.linalg.norm(self.direction)
        reference = np.array([1.0, 0, 0]) if abs(axis[0]) < 0.9 else np.array([0, 0, 1.0])
        across = reference - (reference @ axis) * axis
        across /= np.linalg.norm(across)
        return np.array([axis, across, np.cross(axis, across)])

    def coordinates(self, points_mm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distance along the axis and from it in mm, and azimuth from 0 to 360 degrees; (N,) each."""
        along_mm, first_mm, second_mm = self.frame @ (points_mm - np.array(self.nozzle_mm)).T
        return along_mm, np.hypot(first_mm, second_mm), np.degrees(np.arctan2(second_mm, first_mm)) % 360

    def components(self, velocities_m_s: FloatArray, points_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Axial and radial velocity; radial is away from the axis."""
        axial, first, second = self.frame @ velocities_m_s.T
        _, _, azimuth_deg = self.coordinates(points_mm)
        angle = np.radians(azimuth_deg)
        return axial, first * np.cos(angle) + second * np.sin(angle)

    def around(self, velocities_m_s: FloatArray, points_mm: FloatArray) -> FloatArray:
        """Velocity around the axis, towards growing azimuths; (N,)."""
        _, first, second = self.frame @ velocities_m_s.T
        _, _, azimuth_deg = self.coordinates(points_mm)
        angle = np.radians(azimuth_deg)
        return np.asarray(second * np.cos(angle) - first * np.sin(angle))

    def crossings_mm(self, points_mm: FloatArray, velocities_m_s: FloatArray) -> FloatArray:
        """Where lines along velocities cross the plane of the nozzle, from it, (N, 2); those beside the axis at it."""
        along_mm, *across_mm = self.frame @ (points_mm - np.array(self.nozzle_mm)).T
        forwards, *aside = self.frame @ (velocities_m_s / np.linalg.norm(velocities_m_s, axis=1, keepdims=True)).T
        beside = forwards < LEAST_FORWARDS
        way_mm = along_mm / np.where(beside, 1.0, forwards)
        crossed_mm = np.column_stack([at - way_mm * way for at, way in zip(across_mm, aside, strict=True)])
        return np.where(beside[:, None], 0.0, crossed_mm)

    def reach_mm(self, box_mm: FloatArray) -> tuple[float, float]:
        """From where to where a box reaches along the axis; not before the nozzle."""
        along_mm, _, _ = self.coordinates(corners(box_mm))
        return max(float(along_mm.min()), 0.0), float(along_mm.max())


def direction_name(direction: FloatArray) -> str:
    """A unit vector by the name of its axis, ``x`` or ``-z``, or by its numbers where it has none."""
    largest = int(np.abs(direction).argmax())
    if abs(direction[largest]) > 1 - 1e-9:
        return ("-" if direction[largest] < 0 else "") + "xyz"[largest]
    return "(" + ", ".join(f"{value:.2g}" for value in direction) + ")"


def corners(box_mm: FloatArray) -> FloatArray:
    """The eight corners of a box, (8, 3)."""
    return np.stack(np.meshgrid(*box_mm.T, indexing="ij"), axis=-1).reshape(8, 3)


def cell_volumes_mm3(
    axis: SprayAxis,
    box_mm: FloatArray,
    edges: Sequence[FloatArray],
    share_of: Callable[[FloatArray], FloatArray] | None = None,
) -> FloatArray:
    """Which volume of a box lies in every cell of edges along the axis, from it, and around it; by counting a lattice.

    Parameters
    ----------
    axis : SprayAxis
        Of the spray.
    box_mm : (2, 3) array
        Lower and upper corner.
    edges : three (k + 1,) arrays
        Along the axis and from it in mm, azimuth in degrees.
    share_of : callable, optional
        Which share of places (N, 3) counts; default: all of it.

    Returns
    -------
    (a, r, s) array
        In mm3.
    """
    extents_mm = box_mm[1] - box_mm[0]
    counts = np.maximum(np.ceil(LATTICE * extents_mm / extents_mm.max()), 4).astype(int)
    steps = [(np.arange(n) + 0.5) / n for n in counts]
    lattice = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)
    lattice_mm = box_mm[0] + extents_mm * lattice
    weights = share_of(lattice_mm) if share_of else None
    counted, _ = np.histogramdd(np.column_stack(axis.coordinates(lattice_mm)), bins=list(edges), weights=weights)
    volumes: FloatArray = counted * np.prod(extents_mm) / len(lattice)
    return volumes
