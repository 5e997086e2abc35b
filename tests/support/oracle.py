"""Reconstruction as a textbook writes it: float64, numpy, no speed. What the kernels are measured against."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from processing.analysis.quality import Volume, local_maxima
from processing.geometry import ViewMapping, view_camera
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.planning.fixed_point import FixedPoint
from processing.reconstruction.planning.node_view import NodeView
from processing.reconstruction.planning.plan import Plan
from processing.reconstruction.planning.rectified_view import RectifiedView
from processing.studies.detection import DetectionRates
from processing.volume import VoxelGrid

Array = NDArray[np.float64]
Position = Callable[[Array, Array, Array], tuple[Array, Array]]


def bilinear(image: NDArray[np.floating], u: Array, v: Array) -> Array:
    """Bilinear samples of an image that is surrounded by zeros."""
    framed = np.pad(np.asarray(image, dtype=np.float64), ((1, 2), (1, 2)))
    u, v = np.clip(u + 1, 0, image.shape[1] + 1), np.clip(v + 1, 0, image.shape[0] + 1)
    iu, iv = np.floor(u).astype(int), np.floor(v).astype(int)
    fu, fv = u - iu, v - iv
    above = framed[iv, iu] * (1 - fu) + framed[iv, iu + 1] * fu
    below = framed[iv + 1, iu] * (1 - fu) + framed[iv + 1, iu + 1] * fu
    return np.asarray(above * (1 - fv) + below * fv)


def combine(samples: Sequence[Array], method: ReconstructionMethod) -> Array:
    if method is ReconstructionMethod.MINLOS:
        return np.asarray(np.min(samples, axis=0))
    product = np.prod(samples, axis=0)
    return np.asarray(product if method is ReconstructionMethod.MLOS else product ** (1 / len(samples)))


def voxel_indices(grid: VoxelGrid) -> Array:
    """(nz, ny, nx, 3), in the order z, y, x."""
    return np.stack(np.meshgrid(*map(np.arange, grid.shape), indexing="ij"), axis=-1).astype(float)


def seen_by(mapping: ViewMapping, grid: VoxelGrid) -> tuple[Array, Array]:
    """Columns and rows of the recorded image at which every voxel is seen."""
    image_px = mapping.project(grid.to_mm(voxel_indices(grid).reshape(-1, 3))).reshape(*grid.shape, 2)
    return image_px[..., 0], image_px[..., 1]


def line_of_sight(
    mappings: Sequence[ViewMapping],
    grid: VoxelGrid,
    images: Sequence[NDArray[np.float32]],
    method: ReconstructionMethod,
) -> Array:
    """The paper's way: bilinear interpolation of the recorded images at the projection of every voxel."""
    return combine([bilinear(image, *seen_by(m, grid)) for m, image in zip(mappings, images, strict=True)], method)


def planned_positions(view: RectifiedView | NodeView, grid: VoxelGrid) -> tuple[Array, Array]:
    """Columns and rows of the resampled image at which a plan sees every voxel."""
    z, y, x = np.moveaxis(voxel_indices(grid), -1, 0)
    if isinstance(view, RectifiedView):
        plane = z.astype(int)
        return (
            view.scale[plane] * x + view.shift_u_px[plane],
            view.scale[plane] * y + view.shift_v_px[plane],
        )
    u, v, _ = np.moveaxis(node_values(view, grid), -1, 0)
    return u, v


def node_values(view: NodeView, grid: VoxelGrid) -> Array:
    """Column, row and area (nz, ny, nx, 3), linear between the nodes."""
    values = np.moveaxis(view.nodes.astype(np.float64), 0, -1)
    for axis, n in enumerate(grid.shape):
        at = np.arange(n) / view.spacing
        first = np.floor(at).astype(int)
        weight = (at - first).reshape([-1 if a == axis else 1 for a in range(4)])
        values = np.take(values, first, axis) * (1 - weight) + np.take(values, first + 1, axis) * weight
    return values


def planned_samples(plan: Plan, resampled: Sequence[FixedPoint]) -> list[Array]:
    """What every view sees at every voxel, in its resampled image."""
    return [
        bilinear(image.intensity, *planned_positions(view, plan.grid))
        for view, image in zip(plan.views, resampled, strict=True)
    ]


def planned_line_of_sight(plan: Plan, images: Sequence[NDArray[np.float32]], method: ReconstructionMethod) -> Array:
    """The same as the kernels compute, from resampled images."""
    return combine(planned_samples(plan, plan.resample(images)), method)


def project_rectified(view: RectifiedView, volume: Array, shape: tuple[int, int]) -> Array:
    """Every pixel sums the bilinear interpolations of all planes, times the path through one of them."""
    rows, columns = (np.arange(n, dtype=float) for n in shape)
    image = np.zeros(shape)
    for plane, scale, left, top in zip(volume, view.scale, view.shift_u_px, view.shift_v_px, strict=True):
        y, x = np.meshgrid((rows - top) / scale, (columns - left) / scale, indexing="ij")
        image += bilinear(plane, x, y)
    foot_u, foot_v, distance = view.foot
    return image * np.hypot(1, np.hypot((columns - foot_u) / distance, (rows[:, None] - foot_v) / distance))


def project_nodes(view: NodeView, volume: Array, shape: tuple[int, int]) -> Array:
    """Every voxel spreads over four pixels: the adjoint of sampling, times the area of the voxel."""
    u, v, area = np.moveaxis(node_values(view, VoxelGrid(volume.shape, (0, 0, 0), 1.0)), -1, 0)
    u, v = np.clip(u, 0, shape[1] - 2), np.clip(v, 0, shape[0] - 2)
    iu, iv = np.floor(u).astype(int), np.floor(v).astype(int)
    fu, fv = u - iu, v - iv
    image = np.zeros(shape)
    for down, right in np.ndindex(2, 2):
        weight = (fv if down else 1 - fv) * (fu if right else 1 - fu)
        np.add.at(image, (iv + down, iu + right), volume * area * weight)
    return image


def project(view: RectifiedView | NodeView, volume: Array, shape: tuple[int, int]) -> Array:
    if isinstance(view, RectifiedView):
        return project_rectified(view, volume, shape)
    return project_nodes(view, volume, shape)


MOST_RATIO = 16
"""How much brighter a view may make a voxel at once."""


def start_of(plan: Plan, images: Sequence[NDArray[np.float32]]) -> Array:
    """MLOS; of more than four views as bright as of four."""
    return planned_line_of_sight(plan, images, ReconstructionMethod.MLOS) ** min(1.0, 4 / len(images))


def smart(
    plan: Plan, images: Sequence[NDArray[np.float32]], iterations: int, *, relaxation: float = 1, by_views: bool = False
) -> tuple[Array, list[float]]:
    """SMART, or MART by views, from MLOS; volume and relative residuals.

    Nothing is corrected where the projection is the image to half a count, or nothing.
    """
    resampled = plan.resample(images)
    recorded, half_counts = [image.intensity.astype(np.float64) for image in resampled], [i.unit / 2 for i in resampled]
    nothing = 1e-7 * 2 ** np.ceil(np.log2(max(image.max() for image in images)))
    positions = [planned_positions(view, plan.grid) for view in plan.views]
    volume = start_of(plan, images)

    def projections() -> list[Array]:
        return [project(view, volume, image.shape) for view, image in zip(plan.views, recorded, strict=True)]

    def residual(projected: list[Array]) -> float:
        missed = sum(((p - image) ** 2).sum() for p, image in zip(projected, recorded, strict=True))
        return float(np.sqrt(missed / sum((image**2).sum() for image in recorded)))

    projected = projections()
    factor = sum(image.sum() for image in recorded) / sum(p.sum() for p in projected)
    volume, projected = volume * factor, [p * factor for p in projected]
    residuals = [residual(projected)]
    for _ in range(iterations):
        for number, (image, half, position) in enumerate(zip(recorded, half_counts, positions, strict=True)):
            p = projections()[number] if by_views else projected[number]
            exponent = relaxation if by_views else relaxation / len(recorded)
            wrong = (p > nothing) & (np.abs(p - image) > half)
            ratio = np.where(wrong, (image / np.maximum(p, nothing)) ** exponent, 1)
            volume = volume * bilinear(np.minimum(ratio, MOST_RATIO), *position)
        projected = projections()
        residuals.append(residual(projected))
    return volume, residuals


AZIMUTHS_DEG = (45.0, 15.0, -15.0, -45.0, 30.0, -30.0, 0.0, 60.0)
DISTORTIONS = ((2.0, 50, 0.004, -0.003, 0), (-1.5, 20, -0.003, 0.004, 0), (2.5, 0, 0.002, 0.005, 0))


def cameras(count: int, roll_deg: float = 0.0, scale_px_per_mm: float = 60.0) -> list[ViewMapping]:
    """Distorted cameras of different image sizes around the volume, each seeing about 5 mm."""
    return [
        view_camera(
            azimuth_deg,
            focal_length_mm=85,
            magnification=0.43,
            scale_px_per_mm=scale_px_per_mm,
            image_size_px=(int(5.4 * scale_px_per_mm) + 3 * number, int(4.5 * scale_px_per_mm) + 2 * number),
            pitch_deg=2.0 * (number % 3 - 1),
            roll_deg=roll_deg * (1 + 0.1 * number),
            distortion=np.array(DISTORTIONS[number % 3]),
        )
        for number, azimuth_deg in enumerate(AZIMUTHS_DEG[:count])
    ]


def detection_rates(
    truth_voxel: NDArray[np.float64], volume: Volume, threshold: float, radius_voxel: float = 2.0
) -> DetectionRates:
    """Compare the peaks of a reconstruction with true positions.

    Parameters
    ----------
    truth_voxel : (N, 3) array
        True positions as voxel indices (z, y, x), N > 0.
    volume : (z, y, x) array
        Reconstruction.
    threshold : float
        Lower peaks do not count.
    radius_voxel : float
        How far a peak may lie from its droplet.
    """
    peaks = local_maxima(volume, threshold)
    if not len(peaks):
        return DetectionRates(found=0.0, ghosts=0.0)
    to_peak, _ = cKDTree(peaks).query(truth_voxel)
    to_truth, _ = cKDTree(truth_voxel).query(peaks)
    return DetectionRates(float(np.mean(to_peak <= radius_voxel)), float(np.mean(to_truth > radius_voxel)))
