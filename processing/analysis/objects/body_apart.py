"""A large body that does not hang together with the nozzle: a sheet that is torn off, or a nozzle stated elsewhere.

A break-up length is short then, however surely. Ligaments lie apart in every spray, and are shorter: in simulated shots
of fans and cones the longest one has less than 0.4 of the length of what hangs together with the nozzle.
"""

import numpy as np
from numpy.typing import NDArray

from processing.analysis.objects.break_up import Nozzle
from processing.analysis.objects.dark_voxels import DarkVoxels
from processing.analysis.objects.liquid_objects import LiquidObjects, ObjectClass

LEAST_RELATIVE_LENGTH = 0.5
"""Of a body that is told, over what hangs together with the nozzle."""


def body_apart(
    voxels: DarkVoxels, numbers: NDArray[np.int32], objects: LiquidObjects, nozzle: Nozzle
) -> tuple[float, float] | None:
    """From where to where along the axis the longest body goes that lies apart, in mm; None where there is no long one.

    Parameters
    ----------
    voxels : DarkVoxels
        Of which the objects are.
    numbers : (voxels,) int array
        Number of the object of each.
    objects : LiquidObjects
        All of them, a row each.
    nozzle : Nozzle
        Where the liquid comes from.
    """
    is_core = objects.classes == ObjectClass.CORE
    apart = objects.is_told & ~is_core
    if not is_core.any() or not apart.any():
        return None
    longest = int(np.argmax(np.where(apart, objects.lengths_mm, 0)))
    if objects.lengths_mm[longest] < LEAST_RELATIVE_LENGTH * objects.lengths_mm[is_core].max():
        return None
    along_mm = nozzle.along_mm(voxels.where(numbers == longest).points_mm)
    return float(along_mm.min()), float(along_mm.max())
