"""The liquid sheet of a nozzle: rays from the orifice, waves across them, and the edge where it breaks up.

A point is (s, angle): s the distance from the orifice along a straight ray, the angle that of the ray. A hollow
cone is closed around y, a flat fan lies in the x-y plane.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from processing.synthetic.stamping import FloatArray

_WAVELENGTH_MM = 0.9
_WAVE_AMPLITUDE_MM = 0.10
"""Of the waves at the edge of the sheet; they grow with the square of the distance."""


class SprayShape(Protocol):
    """How the rays of a sheet fan out."""

    angle_range_rad: tuple[float, float]
    """First and last angle of the rays."""
    arc_factor: float
    """Arc length per distance from the orifice and per angle."""
    free_edges_rad: tuple[float, ...]
    """Angles at which the sheet ends sideways; none where it is closed."""

    def directions(self, angles_rad: FloatArray) -> FloatArray:
        """Unit vectors (N, 3) along the rays."""

    def normals(self, angles_rad: FloatArray) -> FloatArray:
        """Unit vectors (N, 3) across the sheet."""


class HollowCone:
    """Rays on a cone around y; the angle is the azimuth."""

    def __init__(self, full_angle_rad: float) -> None:
        self.angle_range_rad: tuple[float, float] = (-np.pi, np.pi)
        self.arc_factor = float(np.sin(full_angle_rad / 2))
        self.free_edges_rad: tuple[float, ...] = ()
        self._half_angle_rad = full_angle_rad / 2

    def directions(self, angles_rad: FloatArray) -> FloatArray:
        """Unit vectors (N, 3) along the rays."""
        sine, cosine = np.sin(self._half_angle_rad), np.cos(self._half_angle_rad)
        return np.column_stack([sine * np.cos(angles_rad), np.full(len(angles_rad), cosine), sine * np.sin(angles_rad)])

    def normals(self, angles_rad: FloatArray) -> FloatArray:
        """Unit vectors (N, 3) across the sheet."""
        sine, cosine = np.sin(self._half_angle_rad), np.cos(self._half_angle_rad)
        return np.column_stack(
            [cosine * np.cos(angles_rad), np.full(len(angles_rad), -sine), cosine * np.sin(angles_rad)]
        )


class FlatFan:
    """Rays in the x-y plane; the angle is measured from y."""

    def __init__(self, full_angle_rad: float) -> None:
        self.angle_range_rad: tuple[float, float] = (-full_angle_rad / 2, full_angle_rad / 2)
        self.arc_factor = 1.0
        self.free_edges_rad: tuple[float, ...] = self.angle_range_rad

    def directions(self, angles_rad: FloatArray) -> FloatArray:
        """Unit vectors (N, 3) along the rays."""
        return np.column_stack([np.sin(angles_rad), np.cos(angles_rad), np.zeros(len(angles_rad))])

    def normals(self, angles_rad: FloatArray) -> FloatArray:
        """Unit vectors (N, 3) across the sheet."""
        return np.tile([0.0, 0.0, 1.0], (len(angles_rad), 1))


@dataclass(frozen=True)
class NozzleFlow:
    """What leaves the nozzle, and how it breaks up.

    Parameters
    ----------
    orifice_mm : (x, y, z)
        Centre of the orifice.
    orifice_diameter_mm : float
        d0.
    velocity_mm_per_s : float
        Velocity of the sheet.
    breakup_mm : float
        Mean distance from the orifice at which the sheet ends.
    holes, ligaments, droplets : int
        Perforations of the sheet; ligaments; droplets down to ``bottom_mm``.
    median_diameter_mm, diameter_spread : float
        Log-normal distribution of droplet diameters: median, and sigma of the logarithm.
    spread_rad : float
        Standard deviation of the droplets' flight angle across the sheet.
    bottom_mm : float
        y at which the spray leaves the scene.
    """

    orifice_mm: tuple[float, float, float]
    orifice_diameter_mm: float
    velocity_mm_per_s: float
    breakup_mm: float
    holes: int
    ligaments: int
    droplets: int
    median_diameter_mm: float
    diameter_spread: float
    spread_rad: float
    bottom_mm: float


class Periodic:
    """A random smooth function of the angle with period 1 in the fraction of the angle range, standard deviation 1."""

    def __init__(self, rng: np.random.Generator, modes: int) -> None:
        self._orders = np.arange(1, modes + 1)
        self._phases = rng.uniform(0, 2 * np.pi, modes)

    def __call__(self, fraction: FloatArray) -> FloatArray:
        """Values (N,) at fractions (N,) of the angle range."""
        waves = np.cos(2 * np.pi * self._orders * fraction[:, None] + self._phases)
        return np.asarray(waves.sum(axis=1) * np.sqrt(2 / len(self._orders)), dtype=np.float64)


class Sheet:
    """One random realisation of a sheet."""

    def __init__(self, shape: SprayShape, flow: NozzleFlow, rng: np.random.Generator) -> None:
        self.shape, self.flow = shape, flow
        self._edge, self._phase, self._streaks = Periodic(rng, 9), Periodic(rng, 5), Periodic(rng, 40)

    def fraction(self, angles_rad: FloatArray) -> FloatArray:
        """Angles (N,) as fractions 0..1 of the range of the shape."""
        first_rad, last_rad = self.shape.angle_range_rad
        return np.asarray((angles_rad - first_rad) / (last_rad - first_rad), dtype=np.float64)

    def edge_mm(self, angles_rad: FloatArray) -> FloatArray:
        """Distance s at which the sheet ends, (N,)."""
        relative = np.clip(1 + 0.13 * self._edge(self.fraction(angles_rad)), 0.6, 1.4)
        return np.asarray(self.flow.breakup_mm * relative, dtype=np.float64)

    def points(self, s_mm: FloatArray, angles_rad: FloatArray, across_mm: FloatArray | float = 0.0) -> FloatArray:
        """Points (N, 3) of the wavy sheet, ``across_mm`` away from it."""
        lift_mm = _WAVE_AMPLITUDE_MM * np.minimum(s_mm / self.flow.breakup_mm, 1.5) ** 2
        offset_mm = across_mm + lift_mm * np.sin(self._wave_phase(s_mm, angles_rad))
        rays = s_mm[:, None] * self.shape.directions(angles_rad)
        return self.flow.orifice_mm + rays + offset_mm[:, None] * self.shape.normals(angles_rad)

    def opacities(self, s_mm: FloatArray, angles_rad: FloatArray) -> FloatArray:
        """Opacity of the film seen face on: thick at the orifice, with the waves' bands and streaks along the flow."""
        bands = 1 + 0.8 * np.cos(self._wave_phase(s_mm, angles_rad)) * np.minimum(1, s_mm / self.flow.breakup_mm)
        streaks = 1 + 0.35 * self._streaks(self.fraction(angles_rad))
        opacities = 0.042 * bands * streaks * (1 + 3 * np.exp(-s_mm / 0.5))
        return np.asarray(np.clip(opacities, 0.005, 0.6), dtype=np.float64)

    def velocities(self, angles_rad: FloatArray, relative: FloatArray | float = 1.0) -> FloatArray:
        """Velocities (N, 3) in mm/s along the rays, ``relative`` to that of the sheet."""
        speed_mm_per_s = self.flow.velocity_mm_per_s * np.broadcast_to(relative, angles_rad.shape)
        return np.asarray(speed_mm_per_s[:, None] * self.shape.directions(angles_rad), dtype=np.float64)

    def _wave_phase(self, s_mm: FloatArray, angles_rad: FloatArray) -> FloatArray:
        phase_rad = 2 * np.pi * s_mm / _WAVELENGTH_MM + 1.5 * self._phase(self.fraction(angles_rad))
        return np.asarray(phase_rad, dtype=np.float64)
