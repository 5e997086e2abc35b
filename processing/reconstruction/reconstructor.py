"""Reconstructor: what the exposures of a run share, so that each reconstruction finds its memory warm."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from processing.kernels import DEFAULT_THREADS
from processing.preprocessing import Intensity
from processing.reconstruction.byte_slabs import in_bytes
from processing.reconstruction.choices import ReconstructionMethod, VoxelType
from processing.reconstruction.line_of_sight import volume_of_sight
from processing.reconstruction.planning.plan import Plan
from processing.reconstruction.settings import ReconstructionSettings
from processing.reconstruction.slab_volume import SLAB_ROWS, Slabs, SlabVolume
from processing.reconstruction.smart import SmartResult, mart, smart


@dataclass(eq=False)
class Reconstructor:
    """A plan with the memory that reconstructions by it use again: fresh memory costs more than they do.

    It serves one exposure at a time, and one thread.

    Parameters
    ----------
    plan : Plan
        Geometry of views and grid.
    settings : ReconstructionSettings
        Method, options and type of voxels.
    images : tuple of tuples of (rows, columns) float32 arrays
        For preprocessed images of two exposures, one per view: those of the next one come while one is reconstructed.
    resampled : tuple of (rows, columns) int16 arrays
        For what the kernels sample, one per view.
    memory : (nz, rows, nx) array
        For a slab of the volume; no more of it is in memory at once.
    threads : int
        The results do not depend on it.
    """

    plan: Plan
    settings: ReconstructionSettings
    images: tuple[tuple[Intensity, ...], ...]
    resampled: tuple[NDArray[np.int16], ...]
    memory: NDArray[Any]
    threads: int = DEFAULT_THREADS
    _refined: SmartResult | None = field(default=None, init=False, repr=False)
    _exposures: int = field(default=0, init=False, repr=False)

    @classmethod
    def of(cls, plan: Plan, settings: ReconstructionSettings, threads: int = DEFAULT_THREADS) -> "Reconstructor":
        """A reconstructor with all its memory."""
        nz, ny, nx = plan.grid.shape
        return cls(
            plan,
            settings,
            images=tuple(
                tuple(np.empty(view.image_size_px[::-1], np.float32) for view in plan.views) for _ in range(2)
            ),
            resampled=plan.empty_images(),
            memory=np.empty((nz, min(SLAB_ROWS, ny), nx), settings.voxels.computed.value),
            threads=threads,
        )

    def reconstruct(self, images: Sequence[Intensity]) -> tuple[SlabVolume, tuple[float, ...]]:
        """Reconstruct one exposure by the method of the settings.

        Parameters
        ----------
        images : sequence of (rows, columns) float32 arrays
            Preprocessed, one per view.

        Returns
        -------
        SlabVolume
            Its slabs are made when they are asked for, in memory that the next exposure takes: from then on they are
            a RuntimeError.
        tuple of float
            The residuals of SMART and MART, see ``processing.reconstruction.smart.SmartResult``.
        """
        self._exposures += 1
        volume, brightest, residuals = (self._refine if self.settings.method.iterative else self._look)(images)
        if self.settings.voxels is VoxelType.UINT8:
            volume = in_bytes(volume, brightest)
        return replace(volume, slabs=self._while_latest(volume.slabs, self._exposures)), residuals

    def _while_latest(self, slabs: Slabs, exposure: int) -> Slabs:
        coming = iter(slabs)
        while self._exposures == exposure:
            slab = next(coming, None)
            if slab is None:
                return
            yield slab
        raise RuntimeError(f"slabs of exposure {exposure} are gone: exposure {self._exposures} took their memory")

    def _look(self, images: Sequence[Intensity]) -> tuple[SlabVolume, float, tuple[float, ...]]:
        volume, brightest = volume_of_sight(
            self.plan, images, self.settings.method, self.memory, resampled=self.resampled, threads=self.threads
        )
        return volume, brightest, ()

    def _refine(self, images: Sequence[Intensity]) -> tuple[SlabVolume, float, tuple[float, ...]]:
        solve = smart if self.settings.method is ReconstructionMethod.SMART else mart
        result = solve(
            self.plan,
            images,
            iterations=self.settings.iterations,
            relaxation=self.settings.relaxation,
            least_gain=self.settings.least_gain,
            memory=self._refined,
            threads=self.threads,
        )
        self._refined = result
        sparse = result.sparse
        return sparse.slabs(self.memory, self.threads), sparse.brightest(self.threads), result.residuals
