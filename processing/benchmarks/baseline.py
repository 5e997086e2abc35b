"""The yardstick of the speed study: reconstruction as one would write it with numpy and OpenCV, plane by plane.

Every plane of the volume is a homography of every image; lens distortion it could not do.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import astuple, dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.benchmarks.scene import Image, SpeedStudy
from processing.geometry import PinholeCamera
from processing.volume import VoxelGrid


@dataclass(frozen=True)
class Timing:
    """Of one run, or the median of several."""

    wall_s: float
    cpu_s: float


def measure(work: Callable[[], object], repeats: int) -> Timing:
    """Run something once to warm up, then ``repeats`` times for the median wall and CPU time."""
    work()
    times = [astuple(measure_once(work)) for _ in range(repeats)]
    wall_s, cpu_s = np.median(times, axis=0)
    return Timing(float(wall_s), float(cpu_s))


def measure_once(work: Callable[[], object]) -> Timing:
    """Run something that takes long, once."""
    wall_s, cpu_s = time.perf_counter(), time.process_time()
    work()
    return Timing(time.perf_counter() - wall_s, time.process_time() - cpu_s)


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
