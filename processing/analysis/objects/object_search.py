"""ObjectSearch: where objects are looked for; and all that one exposure says of liquid that is no droplet."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.analysis.objects.break_up import THRESHOLD, THRESHOLDS, Nozzle, Reach, core_of, reach_of
from processing.analysis.objects.dark_voxels import DarkVoxels, connected, dark_voxels
from processing.analysis.objects.liquid_objects import LiquidObjects, liquid_objects
from processing.analysis.objects.seeing_views import (
    UnseenMap,
    map_grid,
    pixels_of,
    places_of,
    seeing_views,
    unknown_shares,
)
from processing.analysis.objects.silhouettes import LEAST_VIEWS, sights
from processing.geometry import FloatArray, ViewMapping
from processing.kernels import DEFAULT_THREADS
from processing.preprocessing import Intensity
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.line_of_sight import slabs_of_sight
from processing.reconstruction.planning.plan import Plan, plan_reconstruction
from processing.reconstruction.slab_volume import SLAB_ROWS
from processing.volume import VoxelGrid

PITCH_PX = 1.5
"""Width of a voxel, over that of a pixel: of two, threads of 50 um are too thin; one costs three times as much."""
LEAST_KNOWING = 2
"""So many views must know something of a place that is dark."""
NO_NOZZLE = "nobody stated where the nozzle is: add [spray] nozzle_mm, axis to the run, or measure with --nozzle X,Y,Z"


@dataclass(frozen=True, eq=False)
class ObjectSearch:
    """What the exposures of a run share.

    Parameters
    ----------
    plan : Plan
        Of the grid in which objects are looked for.
    mappings : tuple of ViewMapping
        Of the views.
    sight : (views, 2, 3) array
        How views see motions.
    places : VoxelGrid
        At which it is asked how many views see.
    pixels : tuple of (N, 2) arrays
        Where each view sees them.
    nozzle : Nozzle | None
        Where the liquid comes from.
    """

    plan: Plan
    mappings: tuple[ViewMapping, ...]
    sight: FloatArray
    places: VoxelGrid
    pixels: tuple[NDArray[np.int32], ...]
    nozzle: Nozzle | None = None


@dataclass(frozen=True, eq=False)
class ExposureObjects:
    """What one exposure says.

    Parameters
    ----------
    objects : LiquidObjects
        Those that are no droplets.
    reach : Reach
        How far liquid hangs together with the nozzle.
    blind_share, unjudged_share : float
        Of the volume: no view sees it, and fewer than three do.
    unseen : UnseenMap
        Where too few views see.
    reason : str | None
        Why there are no objects.
    bodies : tuple of (M, 3) arrays
        Voxels of the hull of each object, in mm.
    """

    objects: LiquidObjects
    reach: Reach
    blind_share: float
    unjudged_share: float
    unseen: UnseenMap
    reason: str | None = None
    bodies: tuple[FloatArray, ...] = ()


def plan_objects(mappings: Sequence[ViewMapping], grid: VoxelGrid, nozzle: Nozzle | None = None) -> ObjectSearch:
    """Plan the search for objects.

    Parameters
    ----------
    mappings : sequence of ViewMapping
        Of the views.
    grid : VoxelGrid
        All that they see in common, about one voxel per pixel; objects are looked for in a coarser one.
    nozzle : Nozzle, optional
        For the break-up length.
    """
    coarse = coarser(grid)
    places = map_grid(coarse)
    pixels = tuple(pixels_of(mapping, places_of(places)) for mapping in mappings)
    plan = plan_reconstruction(mappings, coarse)
    return ObjectSearch(plan, tuple(mappings), sights(mappings, coarse), places, pixels, nozzle)


def coarser(grid: VoxelGrid) -> VoxelGrid:
    """A grid of wider voxels within another one."""
    nz, ny, nx = (max(1, int(n / PITCH_PX)) for n in grid.shape)
    return VoxelGrid((nz, ny, nx), grid.origin_mm, PITCH_PX * grid.pitch_mm)


def measure_objects(
    images: Sequence[Intensity],
    search: ObjectSearch,
    *,
    trust: Sequence[Intensity] | None = None,
    threads: int = DEFAULT_THREADS,
) -> ExposureObjects:
    """Look for liquid that is no droplet in one exposure of shadows.

    Parameters
    ----------
    images : sequence of (rows, columns) float32 arrays
        Transmissions, one per view.
    search : ObjectSearch
        Where to look.
    trust : sequence of (rows, columns) float32 arrays, optional
        0 where nothing is known of a pixel: then it says nothing against liquid; two views must know something.
    threads : int
        The result does not depend on it.
    """
    darkness = _darkness(images, trust)
    seeing = seeing_views(darkness, search.pixels, search.places)
    shares = (*unknown_shares(seeing, len(images)), UnseenMap.of(seeing, search.places, len(images)))
    try:
        voxels = _known(_dark(darkness, search, threads), trust, search)
    except ValueError as error:
        return ExposureObjects(LiquidObjects.none(), Reach(reason=str(error)), *shares, str(error))
    reach = reach_of(voxels, search.nozzle) if search.nozzle else Reach(reason=NO_NOZZLE)
    if len(images) < LEAST_VIEWS:
        reason = f"{len(images)} views do not tell shapes: {LEAST_VIEWS} or more do"
        return ExposureObjects(LiquidObjects.none(), reach, *shares, reason)
    told, numbers = _connected(voxels)
    objects = _objects(told, numbers, search)
    bodies = _bodies(told, numbers, np.flatnonzero(objects.is_told))
    return ExposureObjects(objects.told(), reach, *shares, bodies=bodies)


def all_objects(images: Sequence[Intensity], search: ObjectSearch, *, threads: int = DEFAULT_THREADS) -> LiquidObjects:
    """All objects of an exposure, droplets and what may be a ghost included."""
    return _objects(*_connected(_dark(_darkness(images, None), search, threads)), search)


def _darkness(images: Sequence[Intensity], trust: Sequence[Intensity] | None) -> list[Intensity]:
    """Share of the light that is missing; all of it where nothing is known."""
    darkness = [np.clip(1 - image, 0, 1) for image in images]
    if trust is None:
        return darkness
    return [np.where(sure > 0, dark, np.float32(1)) for dark, sure in zip(darkness, trust, strict=True)]


def _dark(darkness: Sequence[Intensity], search: ObjectSearch, threads: int) -> DarkVoxels:
    grid = search.plan.grid
    slab = np.empty((grid.shape[0], min(SLAB_ROWS, grid.shape[1]), grid.shape[2]), np.uint8)
    slabs = slabs_of_sight(search.plan, darkness, ReconstructionMethod.MINLOS, out=slab, threads=threads)
    return dark_voxels(slabs, grid, min(THRESHOLDS))


def _known(voxels: DarkVoxels, trust: Sequence[Intensity] | None, search: ObjectSearch) -> DarkVoxels:
    """Those of which enough views know something: a pixel and its neighbours, which samples mix."""
    if trust is None or all((sure > 0).all() for sure in trust):
        return voxels
    points_mm = voxels.points_mm
    pixels = [pixels_of(mapping, points_mm).T for mapping in search.mappings]
    sures = [cv2.erode((sure > 0).astype(np.uint8), np.ones((5, 5), np.uint8)) for sure in trust]
    known = np.sum([sure[rows, columns] for sure, (columns, rows) in zip(sures, pixels, strict=True)], axis=0)
    return voxels.where(known >= LEAST_KNOWING)


def _connected(voxels: DarkVoxels) -> tuple[DarkVoxels, NDArray[np.int32]]:
    """What is dark enough, and the number of the object of each voxel."""
    dark = voxels.at_least(THRESHOLD)
    return dark, connected(dark)


def _objects(voxels: DarkVoxels, numbers: NDArray[np.int32], search: ObjectSearch) -> LiquidObjects:
    core = core_of(voxels, numbers, search.nozzle) if search.nozzle else None
    return liquid_objects(voxels, numbers, search.sight, core)


def _bodies(voxels: DarkVoxels, numbers: NDArray[np.int32], chosen: NDArray[np.intp]) -> tuple[FloatArray, ...]:
    """Voxels of some objects, in mm."""
    own = voxels.where(np.isin(numbers, chosen))
    owners = numbers[np.isin(numbers, chosen)]
    order, points_mm = np.argsort(owners, kind="stable"), own.points_mm
    ends = np.searchsorted(owners[order], chosen, side="right")
    return tuple(np.split(points_mm[order], ends[:-1])) if len(chosen) else ()
