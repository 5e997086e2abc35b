"""Spray: what is liquid, where, and where it flies; and its truth as a volume of intensities.

Everything is balls. A ligament is a chain of overlapping balls with a common velocity; a liquid sheet is a
lattice of large, faintly opaque balls, so that it darkens towards grazing view as a thin film does.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from processing.synthetic.stamping import Discs, FloatArray, FloatImage, stamp_discs
from processing.volume import VoxelGrid


class LiquidKind(IntEnum):
    """What a ball of the spray is part of."""

    DROPLET = 0
    LIGAMENT = 1
    SHEET = 2


@dataclass(frozen=True, eq=False)
class Spray:
    """Liquid at one instant, as N balls.

    Parameters
    ----------
    positions_mm : (N, 3) array
        Centres (x, y, z); y is the axis of the spray and points down.
    diameters_mm : (N,) array
        Diameters.
    velocities_mm_per_s : (N, 3) array
        Velocities.
    kinds : (N,) uint8 array
        LiquidKind of each ball.
    opacities : (N,) array
        Opacity of the shadow, 1 for droplets and ligaments.
    """

    positions_mm: FloatArray
    diameters_mm: FloatArray
    velocities_mm_per_s: FloatArray
    kinds: NDArray[np.uint8]
    opacities: FloatArray

    def __post_init__(self) -> None:
        count = len(self.diameters_mm)
        shapes = [self.positions_mm.shape, self.velocities_mm_per_s.shape, self.kinds.shape, self.opacities.shape]
        if shapes != [(count, 3), (count, 3), (count,), (count,)]:
            raise ValueError(f"spray of {count} balls: positions, velocities, kinds, opacities have shapes {shapes}")

    def __len__(self) -> int:
        return len(self.diameters_mm)

    @classmethod
    def of_droplets(
        cls, positions_mm: FloatArray, diameters_mm: FloatArray, velocities_mm_per_s: FloatArray | None = None
    ) -> "Spray":
        """Spray of droplets only, at rest unless velocities (N, 3) are given."""
        velocities_mm_per_s = np.zeros_like(positions_mm) if velocities_mm_per_s is None else velocities_mm_per_s
        count = len(diameters_mm)
        kinds = np.full(count, LiquidKind.DROPLET, np.uint8)
        return cls(positions_mm, diameters_mm, velocities_mm_per_s, kinds, np.ones(count))

    @classmethod
    def joined(cls, parts: "Sequence[Spray]") -> "Spray":
        """All balls of several sprays, in their order."""
        return cls(
            np.concatenate([part.positions_mm for part in parts]),
            np.concatenate([part.diameters_mm for part in parts]),
            np.concatenate([part.velocities_mm_per_s for part in parts]),
            np.concatenate([part.kinds for part in parts]),
            np.concatenate([part.opacities for part in parts]),
        )

    def advanced(self, dt_s: float) -> "Spray":
        """The same liquid later: every ball flies on along its velocity."""
        return replace(self, positions_mm=self.positions_mm + dt_s * self.velocities_mm_per_s)

    def of_kind(self, kind: LiquidKind) -> "Spray":
        """The balls of one kind."""
        return self.where(self.kinds == kind)

    def inside(self, grid: VoxelGrid) -> "Spray":
        """The balls whose centres lie within the voxels of a grid."""
        index = grid.to_index(self.positions_mm)
        return self.where(np.all((index >= -0.5) & (index < np.array(grid.shape) - 0.5), axis=1))

    def where(self, mask: NDArray[np.bool_]) -> "Spray":
        """The balls where a mask (N,) is true."""
        return Spray(
            self.positions_mm[mask],
            self.diameters_mm[mask],
            self.velocities_mm_per_s[mask],
            self.kinds[mask],
            self.opacities[mask],
        )


def droplet_volume(spray: Spray, grid: VoxelGrid, sigma_mm: float) -> FloatImage:
    """Truth for the quality factor: the intensities that a perfect reconstruction would hold.

    A ball has the radial profile of its own shadow, a disc under a Gaussian blur; overlapping balls add as
    opacities do, 1 - (1 - a)(1 - b).

    Parameters
    ----------
    spray : Spray
        The liquid; take ``of_kind`` or ``where`` to leave out some of it.
    grid : VoxelGrid
        Where the voxels lie.
    sigma_mm : float
        Blur of the views in object space (``ViewOptics.blur_sigma_px`` / image scale).

    Returns
    -------
    (z, y, x) float32 array
        Intensity, 0 (air) to 1 (liquid).
    """
    if sigma_mm <= 0:
        raise ValueError(f"sigma_mm must be positive, not {sigma_mm}")
    balls = Discs(
        centres=grid.to_index(spray.positions_mm),
        radii_px=0.5 * spray.diameters_mm / grid.pitch_mm,
        sigmas_px=np.full(len(spray), sigma_mm / grid.pitch_mm),
        opacities=spray.opacities,
        smears=np.zeros((len(spray), 3)),
    )
    volume = stamp_discs(balls, grid.shape)
    np.subtract(np.float32(1), volume, out=volume)
    return volume
