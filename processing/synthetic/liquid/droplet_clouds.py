"""Clouds of droplets for studies: how large droplets are, where they are, and how they fly."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from processing.synthetic.spray import Spray
from processing.synthetic.stamping import FloatArray
from processing.volume import VoxelGrid


class SizeDistribution(Protocol):
    """Draws diameters of droplets, each droplet counting once."""

    def diameters_mm(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Diameters (N,) in mm."""


@dataclass(frozen=True)
class LogNormal:
    """The logarithm of the diameter is normal.

    Parameters
    ----------
    median_mm : float
        Half of the droplets are smaller.
    spread : float
        Standard deviation of the natural logarithm.
    least_mm : float
        Smaller droplets are of this size.
    """

    median_mm: float = 0.040
    spread: float = 0.4
    least_mm: float = 0.010

    def diameters_mm(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Diameters (N,) in mm."""
        return np.maximum(rng.lognormal(np.log(self.median_mm), self.spread, count), self.least_mm)


@dataclass(frozen=True)
class RosinRammler:
    """A share exp(-(D / X)^n) of the volume is in droplets larger than D.

    As many small droplets as that takes are without number for n <= 3: droplets below ``least_mm`` are left out.

    Parameters
    ----------
    size_mm : float
        X: 63.2 % of the volume is in smaller droplets.
    exponent : float
        n, 1.5 to 4 for sprays; larger is narrower.
    least_mm : float
        No droplet is smaller.
    """

    size_mm: float = 0.080
    exponent: float = 2.5
    least_mm: float = 0.010

    def diameters_mm(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Diameters (N,) in mm."""
        if self.least_mm <= 0:
            raise ValueError(f"a Rosin-Rammler distribution needs a least diameter above 0, not {self.least_mm} mm")
        largest_mm = max(self.size_mm, self.least_mm) * 30 ** (1 / self.exponent)  # e^-30 of the volume is larger
        edges_mm = np.geomspace(self.least_mm, largest_mm, 4001)
        volume = -np.diff(np.exp(-((edges_mm / self.size_mm) ** self.exponent)))
        numbers = volume / (0.5 * (edges_mm[1:] + edges_mm[:-1])) ** 3
        shares = np.concatenate([[0.0], np.cumsum(numbers)]) / numbers.sum()
        return np.interp(rng.uniform(size=count), shares, edges_mm)


@dataclass(frozen=True)
class Box:
    """Where liquid may be: corners (x, y, z) in mm."""

    lower_mm: tuple[float, float, float]
    upper_mm: tuple[float, float, float]

    @classmethod
    def around(cls, grid: VoxelGrid, margin_mm: float = 0.0) -> "Box":
        """The voxels of a grid and a margin around them: what is measured, and what is only seen."""
        reach_mm = 0.5 * grid.pitch_mm + margin_mm
        x_mm, y_mm, z_mm = (
            (float(a[0]) - reach_mm, float(a[-1]) + reach_mm) for a in (grid.x_mm, grid.y_mm, grid.z_mm)
        )
        return cls((x_mm[0], y_mm[0], z_mm[0]), (x_mm[1], y_mm[1], z_mm[1]))

    @property
    def volume_mm3(self) -> float:
        """Its content."""
        return float(np.prod(np.subtract(self.upper_mm, self.lower_mm)))

    def positions_mm(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Places (N, 3), each as likely as any other."""
        return rng.uniform(self.lower_mm, self.upper_mm, (count, 3))


@dataclass(frozen=True)
class Flow:
    """How liquid flies: along straight lines, faster here than there, no two droplets alike.

    Parameters
    ----------
    velocity_mm_per_s : (x, y, z)
        At the world origin.
    gradient_per_s : three rows of three numbers
        Change of (u, v, w), a row each, per mm along x, y and z.
    scatter_mm_per_s : float
        Standard deviation of each component from droplet to droplet.
    """

    velocity_mm_per_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gradient_per_s: tuple[tuple[float, float, float], ...] = ((0.0, 0.0, 0.0),) * 3
    scatter_mm_per_s: float = 0.0

    def velocities_mm_per_s(self, positions_mm: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Velocities (N, 3) of droplets at positions (N, 3)."""
        mean = self.velocity_mm_per_s + positions_mm @ np.array(self.gradient_per_s).T
        return np.asarray(mean + rng.normal(0, self.scatter_mm_per_s, positions_mm.shape), dtype=np.float64)


STILL = Flow()


def droplet_cloud(
    box: Box, density_per_mm3: float, sizes: SizeDistribution, rng: np.random.Generator, flow: Flow = STILL
) -> Spray:
    """Droplets anywhere in a box, as many as the density says on average; they may overlap.

    Parameters
    ----------
    box : Box
        ``Box.around(grid, margin_mm)``: with a margin, for what lies outside of a measured grid is seen, too.
        ``Spray.inside(grid)`` tells which droplets a measurement should find.
    density_per_mm3 : float
        Number of droplets, the box's volume times this, to the nearest integer.
    sizes : SizeDistribution
        ``LogNormal``, ``RosinRammler``.
    rng : numpy Generator
        Source of places, sizes and velocities, in this order.
    flow : Flow
        How they fly; at rest by default.
    """
    positions_mm = box.positions_mm(round(density_per_mm3 * box.volume_mm3), rng)
    diameters_mm = sizes.diameters_mm(len(positions_mm), rng)
    return Spray.of_droplets(positions_mm, diameters_mm, flow.velocities_mm_per_s(positions_mm, rng))
