"""Which objects are droplets that are told already: round bodies close to each other have one hull, and it is long."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.droplet_table import SizedDroplets
from processing.analysis.objects.liquid_objects import ObjectClass
from processing.analysis.objects.object_search import PITCH_PX, ExposureObjects, ObjectSearch
from processing.geometry import FloatArray, ViewMapping

BEYOND_PX = 1.5
"""So far beyond the edge of a disc reach its blur and the voxels of the hull, 1.2 px at most in simulated shots."""
FIRST_ASKED = 100
"""Voxels of a body; most liquid that is no droplet is known by them."""


def without_told(found: ExposureObjects, droplets: SizedDroplets, search: ObjectSearch) -> ExposureObjects:
    """The objects of an exposure but those whose silhouettes its droplets cover in every view."""
    explained = np.array([_explained(body_mm, droplets, search) for body_mm in found.bodies], dtype=bool)
    kept = ~explained | (found.objects.classes == ObjectClass.CORE)
    bodies = tuple(body_mm for body_mm, keep in zip(found.bodies, kept, strict=True) if keep)
    return replace(found, objects=found.objects.where(kept), bodies=bodies)


def _explained(body_mm: FloatArray, droplets: SizedDroplets, search: ObjectSearch) -> bool:
    radii_px = droplets.diameters_um / 2000 * PITCH_PX / search.plan.grid.pitch_mm + BEYOND_PX
    sample_mm = body_mm[:: 1 + len(body_mm) // FIRST_ASKED]
    return all(
        _covered(part_mm, droplets.points_mm, radii_px, view).all()
        for part_mm in (sample_mm, body_mm)
        for view in search.mappings
    )


def _covered(body_mm: FloatArray, points_mm: FloatArray, radii_px: FloatArray, view: ViewMapping) -> NDArray[np.bool_]:
    """Which voxels (M,) of a body a view sees within discs about some points."""
    body_px, centres_px = view.project(body_mm), view.project(points_mm)
    reach_px = radii_px[:, None]
    near = np.all((centres_px > body_px.min(axis=0) - reach_px) & (centres_px < body_px.max(axis=0) + reach_px), axis=1)
    covered = np.zeros(len(body_px), dtype=bool)
    for centre_px, radius_px in zip(centres_px[near], radii_px[near], strict=True):
        covered |= np.linalg.norm(body_px - centre_px, axis=1) <= radius_px
    return covered
