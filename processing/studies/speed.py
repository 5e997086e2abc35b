"""How fast reconstruction is, as ratios to plain numpy and OpenCV in the same process: the study behind ``bench``.

Ratios compare CPU time. The baseline is OpenCV plane by plane: homographies, so without distortion.
"""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.geometry import PinholeCamera, view_camera
from processing.reconstruction.kernels import _native
from processing.reconstruction.line_of_sight import KERNEL_METHOD, line_of_sight
from processing.reconstruction.method import ReconstructionMethod
from processing.reconstruction.node_view import sample_mapping
from processing.reconstruction.plan import MAX_DEVIATION_PX, Accuracy, Plan, plan_reconstruction
from processing.reconstruction.smart import smart
from processing.volume import VoxelGrid

Image = NDArray[np.float32]

SCALE_PX_PER_MM = 60.0
OPTICS = ((45.0, 100, 0.45, 3.0), (15.0, 85, 0.43, -2.0), (-15.0, 85, 0.44, 2.0), (-45.0, 100, 0.43, -3.0))
"""Azimuth, focal length, magnification and pitch of the views (Table 1; angles in degrees, lengths in mm)."""
DISTORTIONS = (
    (2.0, 50, 0.004, -0.003, 0),
    (-1.5, 20, -0.003, 0.004, 0),
    (2.5, 0, 0.002, 0.005, 0),
    (-2, 30, 0.005, 0.002, 0),
)
"""1.5 to 3 px in the corners, as macro lenses have."""


@dataclass(frozen=True)
class SpeedStudy:
    """What is measured.

    Parameters
    ----------
    shape : tuple[int, int, int]
        The volume (nz, ny, nx), one voxel per pixel.
    image_size_px : tuple[int, int]
        (width, height) of every view.
    droplets : int
        In a hollow cone around the axis y.
    repeats : int
        Medians are taken over so many runs.
    baseline_planes : int
        The baseline computes so many planes, spread over the volume, and is scaled to all.
    iterations : int
        SMART runs for so many iterations, and is stated per iteration.
    threads : int
        Of the kernels; the baseline has one.
    """

    shape: tuple[int, int, int] = (541, 1036, 1081)
    image_size_px: tuple[int, int] = (1600, 1200)
    droplets: int = 12_000
    repeats: int = 5
    baseline_planes: int = 12
    iterations: int = 5
    threads: int = 2

    @property
    def grid(self) -> VoxelGrid:
        """The volume, centred on the world origin."""
        return VoxelGrid.centred(self.shape, 1 / SCALE_PX_PER_MM)


@dataclass(frozen=True)
class Timing:
    """Median of several runs."""

    wall_s: float
    cpu_s: float


@dataclass(frozen=True)
class KernelSpeed:
    """One kernel. ``ratio_to_naive`` is the CPU time of the baseline, for as many voxels, by its own."""

    name: str
    wall_s: float
    cpu_s: float
    ratio_to_naive: float


@dataclass(frozen=True)
class SpeedResult:
    """All that ``bench`` says of reconstruction."""

    isa: str
    volume: tuple[int, int, int]
    views: int
    naive_mlos_cpu_s: float
    naive_smart_iteration_cpu_s: float
    kernels: tuple[KernelSpeed, ...]


def measure(work: Callable[[], object], repeats: int) -> Timing:
    """Run something once to warm up, then ``repeats`` times for the median wall and CPU time."""
    work()
    times = []
    for _ in range(repeats):
        wall_s, cpu_s = time.perf_counter(), time.process_time()
        work()
        times.append((time.perf_counter() - wall_s, time.process_time() - cpu_s))
    wall_s, cpu_s = np.median(times, axis=0)
    return Timing(float(wall_s), float(cpu_s))


def speed_study(study: SpeedStudy, progress: Callable[[str], None]) -> SpeedResult:
    """Measure baseline and kernels, one after the other.

    Parameters
    ----------
    study : SpeedStudy
        Size and repetitions.
    progress : callable
        Told the name of what is measured next.
    """
    cameras = study_cameras(study.image_size_px)
    images = spray_images(study, cameras)
    progress("baseline: numpy and OpenCV, plane by plane")
    naive_mlos_cpu_s = naive_line_of_sight(study, cameras, images)
    naive_smart_cpu_s = naive_smart_iteration(study, cameras, images)
    kernels = []
    for name, baseline_cpu_s, timing in _kernels(study, cameras, images, naive_mlos_cpu_s, naive_smart_cpu_s):
        progress(f"{name}: {timing.cpu_s:.3f} CPU-s, {baseline_cpu_s / timing.cpu_s:.1f} times the baseline")
        kernels.append(KernelSpeed(name, timing.wall_s, timing.cpu_s, baseline_cpu_s / timing.cpu_s))
    return SpeedResult(
        isa=_native.selected_isa(),
        volume=study.shape,
        views=len(cameras),
        naive_mlos_cpu_s=naive_mlos_cpu_s,
        naive_smart_iteration_cpu_s=naive_smart_cpu_s,
        kernels=tuple(kernels),
    )


def study_cameras(image_size_px: tuple[int, int]) -> list[PinholeCamera]:
    """The four views of the experiment, pitched and distorted."""
    return [
        view_camera(
            azimuth_deg,
            focal_length_mm=focal_length_mm,
            magnification=magnification,
            scale_px_per_mm=SCALE_PX_PER_MM,
            image_size_px=image_size_px,
            pitch_deg=pitch_deg,
            distortion=np.array(distortion),
        )
        for (azimuth_deg, focal_length_mm, magnification, pitch_deg), distortion in zip(
            OPTICS, DISTORTIONS, strict=True
        )
    ]


def spray_images(study: SpeedStudy, cameras: Sequence[PinholeCamera]) -> list[Image]:
    """Shadow intensities of a hollow cone of droplets, preprocessed: nothing between the droplets."""
    rng = np.random.default_rng(1)
    depth_mm, height_mm, width_mm = (n / SCALE_PX_PER_MM for n in study.shape)
    down = rng.uniform(0.02, 1, study.droplets)
    angle_rad, radius = rng.uniform(0, 2 * np.pi, study.droplets), down * rng.normal(0.47, 0.04, study.droplets)
    points_mm = np.column_stack(
        [width_mm * radius * np.cos(angle_rad), height_mm * (down - 0.5), depth_mm * radius * np.sin(angle_rad)]
    )
    diameters_px = np.clip(rng.lognormal(np.log(2.7), 0.45, study.droplets), 0.9, 15)
    return [_draw(camera.project(points_mm), diameters_px, study.image_size_px) for camera in cameras]


def _draw(points_px: NDArray[np.float64], diameters_px: NDArray[np.float64], image_size_px: tuple[int, int]) -> Image:
    canvas = np.zeros(image_size_px[::-1], np.uint8)
    for centre, diameter_px in zip(np.rint(points_px * 16).astype(int), diameters_px, strict=True):
        cv2.circle(canvas, tuple(centre.tolist()), int(diameter_px * 8), 255, cv2.FILLED, cv2.LINE_AA, shift=4)
    blurred = cv2.GaussianBlur(canvas.astype(np.float32) / np.float32(255), (0, 0), 0.7)
    return np.where(blurred < 0.02, np.float32(0), blurred)


def _planes(study: SpeedStudy) -> NDArray[np.float64]:
    chosen = np.linspace(0, study.shape[0] - 1, study.baseline_planes).astype(np.intp)
    return np.take(study.grid.z_mm, chosen)


def _homography(camera: PinholeCamera, grid: VoxelGrid, z_mm: float) -> NDArray[np.float64]:
    to_mm: NDArray[np.float64] = np.array(
        [[grid.pitch_mm, 0, grid.origin_mm[0]], [0, grid.pitch_mm, grid.origin_mm[1]], [0, 0, 1]]
    )
    return np.array(camera.plane_homography(z_mm) @ to_mm, dtype=np.float64)


def naive_line_of_sight(study: SpeedStudy, cameras: Sequence[PinholeCamera], images: Sequence[Image]) -> float:
    """CPU time of MLOS over the whole volume, plane by plane with ``cv2.warpPerspective``."""
    size = (study.shape[2], study.shape[1])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    planes = np.empty((study.baseline_planes, *study.shape[1:]), np.float32)

    def work() -> None:
        for plane, z_mm in zip(planes, _planes(study), strict=True):
            seen = [
                cv2.warpPerspective(image, _homography(camera, study.grid, z_mm), size, flags=flags)
                for camera, image in zip(cameras, images, strict=True)
            ]
            plane[:] = seen[0]
            for other in seen[1:]:
                plane *= other

    with _one_thread():
        return measure(work, study.repeats).cpu_s * study.shape[0] / study.baseline_planes


def naive_smart_iteration(study: SpeedStudy, cameras: Sequence[PinholeCamera], images: Sequence[Image]) -> float:
    """CPU time of one SMART iteration over the whole volume: project every plane, compare, correct every plane."""
    size, seen = (study.shape[2], study.shape[1]), study.image_size_px
    flags = cv2.INTER_LINEAR
    planes = np.full((study.baseline_planes, *study.shape[1:]), 1e-3, np.float32)
    matrices = [[_homography(camera, study.grid, z_mm) for camera in cameras] for z_mm in _planes(study)]

    def work() -> None:
        projections = [np.zeros_like(image) for image in images]
        for plane, to_image in zip(planes, matrices, strict=True):
            for projection, matrix in zip(projections, to_image, strict=True):
                projection += cv2.warpPerspective(plane, matrix, seen, flags=flags)
        ratios = [
            np.sqrt(np.sqrt(image / np.maximum(projection, 1e-3)))
            for image, projection in zip(images, projections, strict=True)
        ]
        for plane, to_image in zip(planes, matrices, strict=True):
            for ratio, matrix in zip(ratios, to_image, strict=True):
                plane *= cv2.warpPerspective(ratio, matrix, size, flags=flags | cv2.WARP_INVERSE_MAP)
        planes[:] = 1e-3

    with _one_thread():
        return measure(work, max(1, study.repeats // 2)).cpu_s * study.shape[0] / study.baseline_planes


@contextmanager
def _one_thread() -> Iterator[None]:
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)


@contextmanager
def _instruction_set(name: str) -> Iterator[None]:
    before = os.environ.get("TOMOSHADOW_ISA")
    os.environ["TOMOSHADOW_ISA"] = name
    try:
        yield
    finally:
        if before is None:
            del os.environ["TOMOSHADOW_ISA"]
        else:
            os.environ["TOMOSHADOW_ISA"] = before


def _kernels(
    study: SpeedStudy, cameras: Sequence[PinholeCamera], images: Sequence[Image], mlos_cpu_s: float, smart_cpu_s: float
) -> Iterator[tuple[str, float, Timing]]:
    """Name, baseline and timing of every kernel; volumes are reused, so that their memory is warm."""
    plan = plan_reconstruction(cameras, study.grid)
    volume = np.zeros(study.shape, np.float16)
    by_sight = partial(line_of_sight, plan, images, threads=study.threads)
    yield "resample", mlos_cpu_s, measure(lambda: plan.resample(images), study.repeats)
    for method in (ReconstructionMethod.MLOS, ReconstructionMethod.MINLOS, ReconstructionMethod.GAVLOS):
        timing = measure(partial(by_sight, method, out=volume), study.repeats)
        yield f"{method.value} float16", mlos_cpu_s, timing
    for isa in _native.available_isas():
        if isa in ("avx2", "avx512"):
            with _instruction_set(isa):
                yield f"mlos float16 {isa}", mlos_cpu_s, measure(partial(by_sight, out=volume), study.repeats)
                dense = partial(_dense, plan, images, volume, study.threads)
                yield f"mlos float16 {isa} dense", mlos_cpu_s, measure(dense, study.repeats)
    for name, other in _other_plans(study, cameras):
        work = partial(line_of_sight, other, images, out=volume, threads=study.threads)
        yield f"mlos float16 {name}", mlos_cpu_s, measure(work, study.repeats)
    yield "smart iteration float16", smart_cpu_s, _smart_iteration(study, plan, images, volume)
    for name, grid in _parts(study.grid):
        part, out = plan_reconstruction(cameras, grid), np.zeros(grid.shape, np.float16)
        work = partial(line_of_sight, part, images, out=out, threads=study.threads)
        yield f"mlos float16 {name}", mlos_cpu_s * out.size / volume.size, measure(work, study.repeats)
    del volume
    single = np.zeros(study.shape, np.float32)
    yield "mlos float32", mlos_cpu_s, measure(partial(by_sight, out=single), study.repeats)


def _dense(plan: Plan, images: Sequence[Image], out: NDArray[np.float16], threads: int) -> None:
    """MLOS of every block, empty or not."""
    views = plan.bind(plan.resample(images, threads), cull=False)
    _native.line_of_sight(views, KERNEL_METHOD[ReconstructionMethod.MLOS], out, threads)


def _other_plans(study: SpeedStudy, cameras: Sequence[PinholeCamera]) -> Iterator[tuple[str, Plan]]:
    yield "fine", plan_reconstruction(cameras, study.grid, Accuracy.FINE)
    yield "exact", Plan(study.grid, tuple(sample_mapping(camera, study.grid, MAX_DEVIATION_PX) for camera in cameras))


def _parts(grid: VoxelGrid) -> Iterator[tuple[str, VoxelGrid]]:
    """One slice and a region of interest, from the middle of the volume."""
    for name, shape in (("slice", (1, *grid.shape[1:])), ("256^3", (256, 256, 256))):
        fitting = tuple(min(pair) for pair in zip(shape, grid.shape, strict=True))
        yield name, VoxelGrid.centred((fitting[0], fitting[1], fitting[2]), grid.pitch_mm)


def _smart_iteration(study: SpeedStudy, plan: Plan, images: Sequence[Image], out: NDArray[np.float16]) -> Timing:
    """One iteration: the time from stop criterion to stop criterion."""
    times: list[tuple[float, float]] = []

    def note(_done: int, _residual: float) -> bool:
        times.append((time.perf_counter(), time.process_time()))
        return False

    smart(plan, images, iterations=1 + study.iterations, stop=note, out=out, threads=study.threads)
    wall_s, cpu_s = np.median(np.diff(times, axis=0), axis=0)
    return Timing(float(wall_s), float(cpu_s))
