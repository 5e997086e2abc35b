"""A droplet that looks the same from everywhere is the same to SMART: what counts is the path of a line of sight.

Round droplets, Gaussian in space, are projected here analytically along the true lines of sight of undistorted cameras;
what a volume looks like is summed voxel by voxel over solid angles. Nothing of the product projects.
"""

from itertools import permutations

import numpy as np
import pytest
from numpy.typing import NDArray

from processing.geometry import PinholeCamera, view_camera
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.line_of_sight import line_of_sight
from processing.reconstruction.planning.node_view import sample_mapping
from processing.reconstruction.planning.plan import Plan, plan_reconstruction
from processing.reconstruction.planning.rectified_view import RectifiedView, rectify
from processing.reconstruction.smart import mart, smart
from processing.volume import VoxelGrid

Array = NDArray[np.float64]
Images = list[NDArray[np.float32]]
SIGMA_VOXEL, PEAK = 1.5, 0.2
GRID = VoxelGrid.centred((60, 90, 90), 1 / 60)
POSITIONS = np.random.default_rng(3).uniform(8, np.array(GRID.shape) - 9, (12, 3))
AZIMUTHS_DEG = (45.0, 15.0, -15.0, -45.0)
DROPLET = PEAK * (2 * np.pi) ** 1.5 * SIGMA_VOXEL**3
"""Integral over the voxels of one droplet."""


def camera(azimuth_deg: float, pitch_deg: float = 0.0, roll_deg: float = 0.0) -> PinholeCamera:
    return view_camera(
        azimuth_deg,
        focal_length_mm=85,
        magnification=0.43,
        scale_px_per_mm=60,
        image_size_px=(150, 140),
        pitch_deg=pitch_deg,
        roll_deg=roll_deg,
    )


def cameras(roll_deg: float = 0.0, pitch_deg: float = 0.0) -> list[PinholeCamera]:
    return [camera(azimuth_deg, pitch_deg * (-1) ** k, roll_deg) for k, azimuth_deg in enumerate(AZIMUTHS_DEG)]


def line_directions(view: PinholeCamera) -> Array:
    """Unit vectors (rows, columns, 3) of the lines of sight of all pixels."""
    width, height = view.image_size_px
    u, v = np.meshgrid(np.arange(float(width)), np.arange(float(height)))
    along = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(view.camera_matrix).T @ view.rotation
    return np.asarray(along / np.linalg.norm(along, axis=-1, keepdims=True))


def image_of(view: PinholeCamera, grid: VoxelGrid = GRID, positions: Array = POSITIONS) -> NDArray[np.float32]:
    """Integrals of the droplets along the lines of sight, in voxel edges."""
    directions = line_directions(view)
    image = np.zeros(directions.shape[:2])
    for position_mm in grid.to_mm(positions):
        beside = np.cross(position_mm - view.centre_mm, directions) / grid.pitch_mm
        image += np.exp(-(beside**2).sum(axis=-1) / (2 * SIGMA_VOXEL**2))
    return np.asarray(PEAK * np.sqrt(2 * np.pi) * SIGMA_VOXEL * image, dtype=np.float32)


def light_of(volume: NDArray[np.float32], view: PinholeCamera, grid: VoxelGrid = GRID) -> float:
    """Sum over the pixels of what a volume looks like: each voxel by the pixels that its cross-section covers."""
    indices = np.argwhere(volume)
    towards_mm = grid.to_mm(indices.astype(np.float64)) - view.centre_mm
    depth_mm, distance_mm = towards_mm @ view.rotation[2], np.linalg.norm(towards_mm, axis=1)
    pixels = (view.camera_matrix[0, 0] * grid.pitch_mm) ** 2 * distance_mm / depth_mm**3
    return float(volume[tuple(indices.T)] @ pixels)


def by_nodes(mappings: list[PinholeCamera]) -> Plan:
    return Plan(GRID, tuple(sample_mapping(mapping, GRID, 0.02) for mapping in mappings))


@pytest.mark.parametrize(
    ("sampled", "roll_deg", "pitch_deg"), [(False, 0, 0), (False, 4, 12), (True, 0, 0), (True, 70, 12)]
)
def test_smart_explains_the_images_of_all_views(sampled: bool, roll_deg: float, pitch_deg: float) -> None:
    views = cameras(roll_deg, pitch_deg)
    images = [image_of(view) for view in views]
    result = smart(by_nodes(views) if sampled else plan_reconstruction(views, GRID), images)
    shares = [light_of(result.volume, view) / image.sum() for view, image in zip(views, images, strict=True)]
    np.testing.assert_allclose(shares, 1, atol=0.01)
    assert result.residuals[-1] <= 0.02
    assert result.volume.sum() == pytest.approx(len(POSITIONS) * DROPLET, rel=0.01)


@pytest.mark.parametrize("azimuths_deg", [(70, 20, -20, -70), (80, 20, -20, -80), (90, -90, 0, 180), (100, 45, 0, -45)])
def test_views_from_the_side_are_explained_as_well(azimuths_deg: tuple[float, ...]) -> None:
    views = [camera(azimuth_deg) for azimuth_deg in azimuths_deg]
    images = [image_of(view) for view in views]
    result = smart(plan_reconstruction(views, GRID), images)
    shares = [light_of(result.volume, view) / image.sum() for view, image in zip(views, images, strict=True)]
    np.testing.assert_allclose(shares, 1, atol=0.01)
    assert result.residuals[-1] <= 0.025


def test_mart_finds_the_same_total_in_every_order_of_views() -> None:
    totals = []
    for views in permutations(cameras()):
        images = [image_of(view) for view in views]
        totals.append(mart(plan_reconstruction(views, GRID), images, iterations=8).volume.sum())
    np.testing.assert_allclose(totals, len(POSITIONS) * DROPLET, rtol=0.01)


@pytest.mark.parametrize("y_mm", [-8.0, 0.0, 8.0])
@pytest.mark.parametrize("x_mm", [-8.0, 8.0])
def test_lines_of_sight_of_one_view_differ_in_their_paths(x_mm: float, y_mm: float) -> None:
    """Towards the edge of the field they are inclined by two degrees more or less: four percent at 45 degrees."""
    grid = VoxelGrid((20, 20, 40), (x_mm, y_mm, -0.2), 1 / 60)
    view = view_camera(45, focal_length_mm=85, magnification=0.43, scale_px_per_mm=60, image_size_px=(1600, 1200))
    planned = rectify(view, grid, 0.95, 0.02)
    along_z = view.ray_directions(grid.to_mm(np.argwhere(np.ones(grid.shape)).astype(float)))[:, 2].reshape(grid.shape)
    z, y, x = np.indices(grid.shape)
    u, v = (planned.scale[z] * at + shift[z] for at, shift in ((x, planned.shift_u_px), (y, planned.shift_v_px)))
    foot_u, foot_v, distance = planned.foot
    paths = np.sqrt(1 + ((u - foot_u) ** 2 + (v - foot_v) ** 2) / distance**2)
    np.testing.assert_allclose(paths, 1 / along_z, rtol=1e-4)
    nodes = sample_mapping(view, grid, 0.02)
    seen_along_z = np.abs(
        np.linalg.det(np.stack([np.gradient(nodes.nodes[:2, 0], 16, axis=a) for a in (1, 2)])[:, :, 0, 0])
    )
    assert nodes.nodes[2, 0, 0, 0] == pytest.approx(seen_along_z / along_z[0, 0, 0], rel=5e-3)


def test_a_line_of_sight_method_sees_no_path() -> None:
    """Round droplets are equally bright in all views: weighed by their cosines, the minimum would always be oblique."""
    views = cameras()
    plan, images = plan_reconstruction(views, GRID), [image_of(view) for view in views]
    peaks = np.rint(POSITIONS).astype(int)
    brightest = PEAK * np.sqrt(2 * np.pi) * SIGMA_VOXEL
    seen = line_of_sight(plan, images, ReconstructionMethod.MINLOS)[tuple(peaks.T)]
    assert seen.min() > 0.8 * brightest
    weighed = [image * np.float32(np.cos(np.deg2rad(a))) for image, a in zip(images, AZIMUTHS_DEG, strict=True)]
    oblique = line_of_sight(plan, weighed, ReconstructionMethod.MINLOS)[tuple(peaks.T)]
    assert np.median(oblique / seen) == pytest.approx(np.cos(np.deg2rad(45)), abs=0.05)


def test_rectified_views_are_what_is_tested_here() -> None:
    assert all(isinstance(view, RectifiedView) for view in plan_reconstruction(cameras(4.0, 12.0), GRID).views)
