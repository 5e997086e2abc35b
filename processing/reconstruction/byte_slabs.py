"""A volume in bytes, and what they lose: 256 steps have no room for voxels much fainter than the brightest."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from processing.reconstruction.choices import VoxelType
from processing.reconstruction.slab_volume import Losses, Slabs, SlabVolume

STEPS = 255


def in_bytes(volume: SlabVolume, brightest: float) -> SlabVolume:
    """The same volume in steps of 1/255 of its brightest voxel; what is lost is known when all slabs have come.

    Parameters
    ----------
    volume : SlabVolume
        Of float16, not negative.
    brightest : float
        No voxel of its slabs is brighter; above 0.
    """
    losses = Losses()
    return replace(
        volume,
        slabs=_slabs(volume.slabs, _steps_by_half(brightest), losses),
        voxels=VoxelType.UINT8,
        unit=volume.unit * brightest / STEPS,
        losses=losses,
    )


def _steps_by_half(brightest: float) -> NDArray[np.uint8]:
    """The step of every float16, by its bits; negative ones and what is no number are not asked for."""
    halves = np.arange(1 << 15, dtype=np.uint16).view(np.float16).astype(np.float64)
    steps = np.minimum(np.nan_to_num(halves), brightest) * (STEPS / brightest) + 0.5
    return np.concatenate([steps.astype(np.uint8), np.zeros(1 << 15, np.uint8)])


def _slabs(slabs: Slabs, steps_by_half: NDArray[np.uint8], losses: Losses) -> Iterator[tuple[int, NDArray[np.uint8]]]:
    for first_row, slab in slabs:
        bits = slab.view(np.uint16)
        steps = np.take(steps_by_half, bits)
        faint = slab[(bits != 0) & (steps == 0)]
        losses.count(
            lost=faint.size,
            lost_sum=float(faint.sum(dtype=np.float64)),
            kept=int(np.count_nonzero(steps)),
            total=float(slab.sum(dtype=np.float64)),
        )
        yield first_row, steps
