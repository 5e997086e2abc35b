"""ObjectSearch: where objects are looked for; and all that one exposure says of liquid that is no droplet."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from processing.analysis.objects.body_apart import body_apart
from processing.analysis.objects.break_up import THRESHOLD, Nozzle, Reach, core_of
from processing.analysis.objects.dark_voxels import DarkVoxels, connected
from processing.analysis.objects.hull import darkness_of, hull_of, known
from processing.analysis.objects.liquid_objects import LiquidObjects, liquid_objects
from processing.analysis.objects.seeing_views import (
    UnseenMap,
    map_grid,
    pixels_of,
    places_of,
    seeing_views,
    unknown_shares,
)
from processing.analysis.objects.sharp_reach import sharp_reach
from processing.analysis.objects.silhouettes import LEAST_VIEWS, sights
from processing.geometry import FloatArray, ViewMapping
from processing.kernels import DEFAULT_THREADS
from processing.preprocessing import Intensity
from processing.reconstruction.planning.plan import Plan, plan_reconstruction
from processing.volume import VoxelGrid

PITCH_PX = 1.5
"""Width of a voxel, over that of a pixel: of two, threads of 50 um are too thin; one costs three times as much. How far
liquid hangs together is asked by finer ones."""
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
    darkness = darkness_of(images, trust)
    seeing = seeing_views(darkness, search.pixels, search.places)
    shares = (*unknown_shares(seeing, len(images)), UnseenMap.of(seeing, search.places, len(images)))
    try:
        voxels = known(hull_of(darkness, search.plan, threads), trust, search.mappings)
    except ValueError as error:
        return ExposureObjects(LiquidObjects.none(), Reach(reason=str(error)), *shares, str(error))
    reach = _reach(darkness, trust, voxels, search, threads)
    if len(images) < LEAST_VIEWS:
        reason = f"{len(images)} views do not tell shapes: {LEAST_VIEWS} or more do"
        return ExposureObjects(LiquidObjects.none(), reach, *shares, reason)
    told, numbers = _connected(voxels)
    objects = _objects(told, numbers, search)
    if search.nozzle is not None and reach.reason is None:
        reach = replace(reach, apart_mm=body_apart(told, numbers, objects, search.nozzle))
    bodies = _bodies(told, numbers, np.flatnonzero(objects.is_told))
    return ExposureObjects(objects.told(), reach, *shares, bodies=bodies)


def all_objects(images: Sequence[Intensity], search: ObjectSearch, *, threads: int = DEFAULT_THREADS) -> LiquidObjects:
    """All objects of an exposure, droplets and what may be a ghost included."""
    return _objects(*_connected(hull_of(darkness_of(images, None), search.plan, threads)), search)


def _reach(
    darkness: Sequence[Intensity],
    trust: Sequence[Intensity] | None,
    voxels: DarkVoxels,
    search: ObjectSearch,
    threads: int,
) -> Reach:
    if search.nozzle is None:
        return Reach(reason=NO_NOZZLE)
    pixel_mm = search.plan.grid.pitch_mm / PITCH_PX
    try:
        return sharp_reach(darkness, trust, search.mappings, voxels, search.nozzle, pixel_mm=pixel_mm, threads=threads)
    except ValueError as error:
        return Reach(reason=str(error))


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
