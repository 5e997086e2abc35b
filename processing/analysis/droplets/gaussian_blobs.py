"""The images of a shot as a sum of Gaussian blobs, and the fit of blobs to images by coordinate descent."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.sight_lattice import SightLattice
from processing.geometry import FloatArray
from processing.kernels import _native

Image = NDArray[np.float32]

DAMPING = 0.02
"""Of positions: faint blobs stay where they are until their light is shared out."""
MAX_STEP_VOXEL = 0.3


@dataclass(frozen=True, eq=False)
class Blobs:
    """Blobs in a grid.

    Parameters
    ----------
    positions_voxel : (N, 3) array
        x, y, z as fractional indices of the grid.
    amplitudes : (N,) array
        Height over the gain of a view.
    """

    positions_voxel: FloatArray
    amplitudes: FloatArray

    @classmethod
    def none(cls) -> "Blobs":
        """No blobs."""
        return cls(np.empty((0, 3)), np.empty(0))

    def __len__(self) -> int:
        return len(self.amplitudes)

    def where(self, chosen: NDArray[np.bool_]) -> "Blobs":
        """The chosen ones."""
        return Blobs(self.positions_voxel[chosen], self.amplitudes[chosen])

    def joined_by(self, positions_voxel: FloatArray) -> "Blobs":
        """These and further ones, which are dark as yet."""
        return Blobs(
            np.vstack([self.positions_voxel, positions_voxel]),
            np.concatenate([self.amplitudes, np.zeros(len(positions_voxel))]),
        )


@dataclass(frozen=True, eq=False)
class BlobOptics:
    """What blobs look like in K views.

    Parameters
    ----------
    gains : (K,) array
        Height of a blob of amplitude 1.
    sigmas_px : (K, 2) array
        Widths along columns and rows.
    shifts_px : (K, 2) array
        How far the images lie beside the calibration, along columns and rows.
    levels : tuple of (rows, columns) float32 arrays
        What images are without blobs: it varies slowly.
    """

    gains: FloatArray
    sigmas_px: FloatArray
    shifts_px: FloatArray
    levels: tuple[Image, ...]

    @property
    def table(self) -> FloatArray:
        """As the kernels take it, (K, 5)."""
        return np.ascontiguousarray(np.column_stack([self.gains, self.sigmas_px, self.shifts_px]))

    @property
    def amplitude_sigma(self) -> float:
        """Standard deviation of the amplitude of a blob that stands alone, in images whose noise is 1."""
        return float(1 / np.sqrt(np.pi * np.sum(self.gains**2 * self.sigmas_px.prod(axis=1))))


@dataclass(frozen=True, eq=False)
class BlobImages:
    """Images whose noise is 1, and where they see the grid.

    Parameters
    ----------
    images : tuple of (rows, columns) float32 arrays
        One per view.
    lattice : SightLattice
        Of the same views.
    threads : int
        Nothing depends on it.
    """

    images: tuple[Image, ...]
    lattice: SightLattice
    threads: int = 1

    def drawn(self, optics: BlobOptics, blobs: Blobs) -> list[Image]:
        """What the views would see of blobs, without level and noise."""
        images = [np.zeros_like(image) for image in self.images]
        self._draw(images, optics, blobs, 1.0)
        return images

    def residuals(self, optics: BlobOptics, blobs: Blobs) -> list[Image]:
        """What the images hold beyond blobs and level."""
        images = [image - level for image, level in zip(self.images, optics.levels, strict=True)]
        self._draw(images, optics, blobs, -1.0)
        return images

    def fitted(
        self,
        optics: BlobOptics,
        blobs: Blobs,
        *,
        sweeps: int,
        scale: float,
        tolerance: float,
        move: bool = True,
        residuals: Sequence[Image] | None = None,
    ) -> Blobs:
        """Blobs that are fitted one after the other, all others fixed, sweep after sweep; none becomes negative.

        Parameters
        ----------
        optics, blobs : BlobOptics, Blobs
            Where to begin.
        sweeps : int
            At most; it ends when no blob changes any more.
        scale : float
            A typical amplitude.
        tolerance : float
            Smaller changes are none: of amplitudes relative to ``scale``, of positions in voxels.
        move : bool
            Positions too, or amplitudes alone.
        residuals : sequence of images, optional
            Those of the blobs, where they are known; they are used up.
        """
        left = list(residuals) if residuals is not None else self.residuals(optics, blobs)
        positions, amplitudes = np.array(blobs.positions_voxel, order="C"), np.array(blobs.amplitudes)
        _native.sweep_blobs(
            left,
            self.lattice.nodes_px,
            self.lattice.spacing,
            optics.table,
            positions,
            amplitudes,
            most=sweeps,
            move=move,
            scale=scale,
            damping=DAMPING,
            max_step=MAX_STEP_VOXEL,
            tolerance=tolerance,
        )
        return Blobs(positions, amplitudes)

    def supports(self, optics: BlobOptics, blobs: Blobs, residuals: Sequence[Image]) -> FloatArray:
        """Sums over the window of every blob in every view (K, N, 4).

        Residual times shape, shape squared, residual squared, and number of pixels.
        """
        out = np.empty((len(self.images), len(blobs), 4))
        _native.weigh_blobs(
            list(residuals),
            self.lattice.nodes_px,
            self.lattice.spacing,
            optics.table,
            *_arrays(blobs),
            out,
            self.threads,
        )
        return out

    def _draw(self, images: list[Image], optics: BlobOptics, blobs: Blobs, factor: float) -> None:
        _native.draw_blobs(
            images, self.lattice.nodes_px, self.lattice.spacing, optics.table, *_arrays(blobs), factor, self.threads
        )


def _arrays(blobs: Blobs) -> tuple[FloatArray, FloatArray]:
    return np.ascontiguousarray(blobs.positions_voxel), np.ascontiguousarray(blobs.amplitudes)
