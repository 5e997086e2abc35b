"""Velocities of the objects of one exposure, a row each, in the order of the objects."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.analysis.objects.liquid_objects import Columns, ObjectClass
from processing.analysis.objects.object_motion import object_motions
from processing.analysis.objects.object_search import ExposureObjects
from processing.geometry import FloatArray, ViewMapping
from processing.preprocessing import Intensity

M_S = 1e6
"""In mm per ns."""
OF_CORE = "it hangs together with the nozzle: its parts move by themselves"
MOST_LETTERS = 80
"""Of a reason."""


@dataclass(frozen=True, eq=False)
class ObjectVelocities:
    """Velocities of the objects of one exposure.

    Parameters
    ----------
    velocities_m_s, sd_m_s : (N, 3) arrays
        (u, v, w) along x, y, z, and their standard deviations; not a number where there is none.
    reasons : (N,) array of str
        Why there is none; empty where there is one.
    """

    velocities_m_s: FloatArray
    sd_m_s: FloatArray
    reasons: NDArray[np.str_]

    def columns(self) -> Columns:
        """Columns by their names, as files have them."""
        return {
            **{f"{name}_m_s": along for name, along in zip("uvw", self.velocities_m_s.T, strict=True)},
            **{f"{name}_sd_m_s": along for name, along in zip("uvw", self.sd_m_s.T, strict=True)},
            "velocity_reason": np.char.encode(self.reasons, "ascii"),
        }


@dataclass(frozen=True, eq=False)
class MovingObjects:
    """Objects of one exposure with their velocities: a table, as files have it."""

    found: ExposureObjects
    velocities: ObjectVelocities | None = None

    def __len__(self) -> int:
        return len(self.found.objects)

    def columns(self) -> Columns:
        """Columns of the objects, and of their velocities where exposures and the time between them are two."""
        return self.found.objects.columns() | (self.velocities.columns() if self.velocities else {})


def object_velocities(
    found: ExposureObjects,
    own: Sequence[Intensity],
    other: Sequence[Intensity],
    mappings: Sequence[ViewMapping],
    later_ns: float,
) -> ObjectVelocities:
    """Velocities of the objects of one exposure by another one.

    Parameters
    ----------
    found : ExposureObjects
        Of the exposure.
    own, other : sequences of (rows, columns) float32 arrays
        Transmissions of both exposures, one per view.
    mappings : sequence of ViewMapping
        Of the views.
    later_ns : float
        When the other one was taken: below 0 before.
    """
    free = np.flatnonzero(found.objects.classes != ObjectClass.CORE)
    motions = object_motions(own, other, mappings, [found.bodies[number] for number in free])
    velocities, sd = np.full((2, len(found.objects), 3), np.nan)
    reasons = np.full(len(found.objects), OF_CORE, dtype=f"U{MOST_LETTERS}")
    velocities[free] = motions.moved_mm * M_S / later_ns
    sd[free] = np.sqrt(np.einsum("nii->ni", motions.covariance_mm2)) * M_S / abs(later_ns)
    reasons[free] = motions.reasons
    return ObjectVelocities(velocities, sd, reasons)
