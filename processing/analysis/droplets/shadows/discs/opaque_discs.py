"""Transmissions as those of opaque discs that light shows blurred, and the fit of discs by coordinate descent."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.gaussian_blobs import Image
from processing.analysis.droplets.shadows.discs.disc_profiles import disc_profiles
from processing.analysis.droplets.shadows.discs.disc_supports import DiscSupports
from processing.analysis.droplets.sight_lattice import SightLattice
from processing.geometry import FloatArray
from processing.kernels import _native

DAMPING = 0.02
"""Of positions, relative to what a pixel knows: faint discs stay where they are until their shadow is shared out."""
LARGEST_SHARE = 0.5
"""Of the largest disc of the table: blur changes with depth."""
NO_DISC = 1e-3
"""Square of the radius, in voxels, with which a candidate enters: as good as none."""


@dataclass(frozen=True, eq=False)
class Discs:
    """Discs in a grid.

    Parameters
    ----------
    positions_voxel : (N, 3) array
        x, y, z as fractional indices of the grid.
    squares_voxel2 : (N,) array
        Radii squared: the shadow of a small disc is linear in them.
    """

    positions_voxel: FloatArray
    squares_voxel2: FloatArray

    @classmethod
    def none(cls) -> "Discs":
        """No discs."""
        return cls(np.empty((0, 3)), np.empty(0))

    def __len__(self) -> int:
        return len(self.squares_voxel2)

    @property
    def radii_voxel(self) -> FloatArray:
        """Radii (N,)."""
        return np.sqrt(self.squares_voxel2)

    def where(self, chosen: NDArray[np.bool_]) -> "Discs":
        """The chosen ones; the very same discs where all are."""
        if chosen.all():
            return self
        return Discs(self.positions_voxel[chosen], self.squares_voxel2[chosen])

    def joined_by(self, positions_voxel: FloatArray, squares_voxel2: FloatArray) -> "Discs":
        """These and further ones."""
        return Discs(
            np.vstack([self.positions_voxel, positions_voxel]), np.concatenate([self.squares_voxel2, squares_voxel2])
        )


@dataclass(frozen=True, eq=False)
class DiscOptics:
    """How K views see discs.

    Parameters
    ----------
    variances_px2 : (K, 3) array
        Of the blur: constant, and times z and z^2 in voxels of the grid.
    shifts_px : (K, 2) array
        How far the images lie beside the calibration, along columns and rows.
    levels : (K,) array
        Of an image without discs.
    condenser_ratio : float, optional
        Numerical aperture of the light over that of the lens, of all views; without it light is incoherent.
    """

    variances_px2: FloatArray
    shifts_px: FloatArray
    levels: FloatArray
    condenser_ratio: float | None = None

    @property
    def profiles(self) -> tuple[NDArray[np.float32], float]:
        """Table and reach of what discs look like, as the kernels take them."""
        found = disc_profiles(self.condenser_ratio)
        return found.table, found.reach

    @property
    def table(self) -> FloatArray:
        """As the kernels take it, (K, 5)."""
        return np.ascontiguousarray(np.column_stack([self.shifts_px, self.variances_px2]))

    @property
    def largest_px(self) -> float:
        """Radius of the largest disc that the table has for the sharpest view."""
        return LARGEST_SHARE * _native.LARGEST_DISC * float(np.sqrt(self.variances_px2[:, 0].min()))

    def blurs_px(self, z_voxel: FloatArray | float) -> FloatArray:
        """Standard deviation of the blur (K, ...) at some depths."""
        z = np.asarray(z_voxel, dtype=np.float64)
        powers = np.stack([np.ones_like(z), z, z**2])
        return np.sqrt(np.maximum(np.tensordot(self.variances_px2, powers, axes=1), _native.LEAST_BLUR_PX**2))


@dataclass(frozen=True, eq=False)
class DiscImages:
    """Transmissions with their weights, and where they see the grid.

    Parameters
    ----------
    images : tuple of (rows, columns) float32 arrays
        One per view; 1 where light passes, 0 in full shadow.
    weights : tuple of (rows, columns) float32 arrays
        One over the variance of a pixel; 0 where nothing is known.
    lattice : SightLattice
        Of the same views.
    threads : int
        Nothing depends on it.
    """

    images: tuple[Image, ...]
    weights: tuple[Image, ...]
    lattice: SightLattice
    threads: int = 1

    def drawn(self, optics: DiscOptics, discs: Discs) -> "Shadows":
        """What discs let through, as if what several of them hide were hidden by each again."""
        shadows = Shadows([np.zeros_like(image) for image in self.images])
        self.add(shadows, optics, discs)
        return shadows

    def add(self, shadows: "Shadows", optics: DiscOptics, discs: Discs, factor: float = 1.0) -> None:
        """Put discs into shadows, or take them away with a factor of -1."""
        _native.draw_discs(
            shadows.logs,
            self.lattice.nodes_px,
            self.lattice.spacing,
            optics.table,
            *optics.profiles,
            *_copies(discs),
            factor,
            self.threads,
        )

    def fitted(
        self, shadows: "Shadows", optics: DiscOptics, discs: Discs, sweeps: "Sweeps"
    ) -> tuple[Discs, FloatArray]:
        """Discs that are fitted one after the other, all others fixed, sweep after sweep.

        Parameters
        ----------
        shadows : Shadows
            Of the discs; they are kept up to date.
        optics, discs : DiscOptics, Discs
            Where to begin.
        sweeps : Sweeps
            How.

        Returns
        -------
        Discs
            As they fit.
        (N,) array
            Information on their squared radii, positions fixed.
        """
        positions, squares = _copies(discs)
        information = np.zeros(len(discs))
        _native.sweep_discs(
            shadows.logs,
            list(self.images),
            list(self.weights),
            self.lattice.nodes_px,
            self.lattice.spacing,
            optics.table,
            *optics.profiles,
            positions,
            squares,
            information,
            most=sweeps.most,
            move=sweeps.move,
            damping=DAMPING * self._typical_weight,
            largest=optics.largest_px**2 / self.lattice.pixels_per_voxel**2,
            tolerance=sweeps.tolerance,
        )
        return Discs(positions, squares), information

    def supports(self, shadows: "Shadows", optics: DiscOptics, discs: Discs) -> DiscSupports:
        """What every view says of every disc, all others fixed."""
        out = np.empty((len(self.images), len(discs), 11))
        _native.weigh_discs(
            shadows.logs,
            list(self.images),
            list(self.weights),
            self.lattice.nodes_px,
            self.lattice.spacing,
            optics.table,
            *optics.profiles,
            *_copies(discs),
            out,
            self.threads,
        )
        return DiscSupports(discs.squares_voxel2, out)

    @property
    def _typical_weight(self) -> float:
        return max(float(np.mean([np.mean(weight) for weight in self.weights])), 1e-12)


@dataclass(frozen=True, eq=False)
class Shadows:
    """Binary logarithms of what discs let through; who draws into them says so.

    Parameters
    ----------
    logs : list of (rows, columns) float32 arrays
        One per view.
    """

    logs: list[Image]

    @property
    def transmissions(self) -> list[Image]:
        """What is let through."""
        return [np.exp2(log) for log in self.logs]


@dataclass(frozen=True)
class Sweeps:
    """How discs are fitted.

    Parameters
    ----------
    most : int
        It ends earlier when no disc changes any more.
    move : bool
        Positions too, or radii alone.
    tolerance : float
        Smaller changes of positions and radii are none, in voxels.
    """

    most: int
    move: bool = True
    tolerance: float = 3e-3


def _copies(discs: Discs) -> tuple[FloatArray, FloatArray]:
    return np.array(discs.positions_voxel, order="C"), np.array(discs.squares_voxel2)
