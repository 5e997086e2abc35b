"""Reconstructor: what the exposures of a run share, so that each reconstruction finds its memory warm."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from processing.kernels import DEFAULT_THREADS
from processing.preprocessing import Intensity
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.line_of_sight import slabs_of_sight
from processing.reconstruction.planning.plan import Plan
from processing.reconstruction.settings import ReconstructionSettings
from processing.reconstruction.slab_volume import SLAB_ROWS, SlabVolume
from processing.reconstruction.smart import SmartResult, mart, smart


@dataclass(eq=False)
class Reconstructor:
    """A plan with the memory that reconstructions by it use again: fresh memory costs more than they do.

    It serves one exposure at a time.

    Parameters
    ----------
    plan : Plan
        Geometry of views and grid.
    settings : ReconstructionSettings
        Method, options and type of voxels.
    images : tuple of (rows, columns) float32 arrays
        For preprocessed images, one per view.
    resampled : tuple of (rows, columns) int16 arrays
        For what the kernels sample, one per view.
    memory : (nz, rows, nx) array
        For a slab of the volume; no more of it is in memory at once.
    threads : int
        The results do not depend on it.
    """

    plan: Plan
    settings: ReconstructionSettings
    images: tuple[Intensity, ...]
    resampled: tuple[NDArray[np.int16], ...]
    memory: NDArray[Any]
    threads: int = DEFAULT_THREADS
    _refined: SmartResult | None = field(default=None, init=False, repr=False)

    @classmethod
    def of(cls, plan: Plan, settings: ReconstructionSettings, threads: int = DEFAULT_THREADS) -> "Reconstructor":
        """A reconstructor with all its memory."""
        nz, ny, nx = plan.grid.shape
        return cls(
            plan,
            settings,
            images=tuple(np.empty(view.image_size_px[::-1], np.float32) for view in plan.views),
            resampled=plan.empty_images(),
            memory=np.empty((nz, min(SLAB_ROWS, ny), nx), settings.voxels.value),
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
            To be used before the next exposure, which takes its memory; a line-of-sight method computes each slab when
            it is asked for.
        tuple of float
            The residuals of SMART and MART, see ``processing.reconstruction.smart.SmartResult``.
        """
        method, voxels = self.settings.method, self.settings.voxels
        if method.iterative:
            return self._refine(images)
        slabs = slabs_of_sight(
            self.plan, images, method, out=self.memory, resampled=self.resampled, threads=self.threads
        )
        return SlabVolume(slabs, voxels, voxels.unit), ()

    def _refine(self, images: Sequence[Intensity]) -> tuple[SlabVolume, tuple[float, ...]]:
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
        return result.sparse.slabs(self.settings.voxels, self.memory, self.threads), result.residuals
