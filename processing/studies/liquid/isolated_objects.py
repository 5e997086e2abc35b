"""Droplets, threads and discs that stand apart from each other, in any direction, and what they are told for."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from processing.analysis.objects.liquid_objects import LiquidObjects, ObjectClass
from processing.analysis.objects.object_search import ObjectSearch, all_objects, plan_objects
from processing.geometry import FloatArray, PinholeCamera
from processing.kernels import DEFAULT_THREADS
from processing.studies.simulated_droplets import study_cameras, study_grid
from processing.synthetic.paper_rig import paper_optics
from processing.synthetic.rendering import render_transmittance
from processing.synthetic.shadow_shots import Counting
from processing.synthetic.spray import Spray
from processing.volume import VoxelGrid

SHAPE = (120, 500, 500)
IMAGE_SIZE_PX = (640, 560)
PLACES = (3, 9)
"""Objects along x and y: no view sees one behind another."""
KINDS = (ObjectClass.DROPLET, ObjectClass.LIGAMENT, ObjectClass.SHEET)
NOISE = 0.012
"""Of the background."""
LOST = "lost"
FOUND_MM = 0.25
"""An object is told where one is as close as that; else it is lost: too small to be dark in all views."""


@dataclass(frozen=True)
class IsolatedObject:
    """A true object, and what it was told for: a class, or ``lost``."""

    seed: int
    kind: str
    told: str
    length_mm: float
    told_length_mm: float
    told_sd_mm: float
    x_mm: float
    y_mm: float
    z_mm: float


@dataclass(frozen=True, eq=False)
class _Body:
    """Balls of an object, in voxels around its middle."""

    kind: ObjectClass
    balls: FloatArray
    radius: float
    length: float


def isolated_objects(seeds: tuple[int, ...], threads: int = DEFAULT_THREADS) -> Iterator[IsolatedObject]:
    """Objects of scenes of 27 each; equal seeds give equal objects."""
    grid, cameras = study_grid(SHAPE), study_cameras(IMAGE_SIZE_PX)
    search = plan_objects(cameras, grid)
    for seed in seeds:
        yield from _scene(seed, grid, cameras, search, threads)


def _scene(
    seed: int, grid: VoxelGrid, cameras: list[PinholeCamera], search: ObjectSearch, threads: int
) -> Iterator[IsolatedObject]:
    rng = np.random.default_rng(seed)
    bodies = [(_place(i, j, rng), _body(rng)) for i in range(PLACES[0]) for j in range(PLACES[1])]
    balls = np.concatenate([place + body.balls for place, body in bodies])
    radii = np.concatenate([np.full(len(body.balls), body.radius) for _, body in bodies])
    spray = Spray.of_droplets(grid.to_mm(balls[:, ::-1]), 2 * radii * grid.pitch_mm)
    images = [
        Counting.of_noise(NOISE).transmission(render_transmittance(camera, spray, view), rng)
        for camera, view in zip(cameras, paper_optics().values(), strict=True)
    ]
    found = all_objects(images, search, threads=threads)
    for place, body in bodies:
        yield _told(seed, grid.to_mm(place[None, ::-1])[0], body, found, grid.pitch_mm)


def _told(seed: int, place_mm: FloatArray, body: _Body, found: LiquidObjects, pitch_mm: float) -> IsolatedObject:
    apart_mm = np.linalg.norm(found.points_mm - place_mm, axis=1)
    at = int(apart_mm.argmin())
    lost = apart_mm[at] > FOUND_MM
    return IsolatedObject(
        seed,
        body.kind.value,
        LOST if lost else str(found.classes[at]),
        body.length * pitch_mm,
        float("nan") if lost else float(found.lengths_mm[at]),
        float("nan") if lost else float(found.length_sd_mm[at]),
        *place_mm.tolist(),
    )


def _place(i: int, j: int, rng: np.random.Generator) -> FloatArray:
    """Middle of an object, x, y, z in voxels."""
    return np.array([60.0 + 190 * i, 30.0 + 55 * j, 60.0]) + rng.uniform(-8, 8, 3)


def _body(rng: np.random.Generator) -> _Body:
    """A droplet of 33 to 167 um, a thread of 0.33 to 0.75 mm, 50 to 83 um thick, or a disc of 0.4 mm, 50 um thick."""
    kind = KINDS[rng.integers(3)]
    if kind is ObjectClass.DROPLET:
        radius = rng.uniform(1.0, 5.0)
        return _Body(kind, np.zeros((1, 3)), radius, 2 * radius)
    first = _unit(rng.normal(size=3))
    if kind is ObjectClass.LIGAMENT:
        length, radius = rng.uniform(20, 45), rng.uniform(1.5, 2.5)
        along = np.arange(-length / 2, length / 2, 0.7 * radius)
        return _Body(kind, along[:, None] * _unit(first * [1, 0.3 if abs(first[1]) > 0.9 else 1, 1]), radius, length)
    second = _unit(np.cross(first, rng.normal(size=3)))
    steps = np.arange(-12, 12.1, 1.5)
    across, along = (values.ravel() for values in np.meshgrid(steps, steps))
    within = np.hypot(across, along) < 12
    disc = np.column_stack([across[within], along[within]]) @ np.stack([second, np.cross(first, second)])
    return _Body(kind, disc, 1.5, 24.0)


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / np.linalg.norm(vector), dtype=np.float64)
