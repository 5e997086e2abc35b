"""How fast reconstruction is, as ratios to plain numpy and OpenCV in the same process: the study behind ``bench``.

Ratios compare CPU time, so that they mean the same on any number of cores.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from processing.benchmarks import targets
from processing.benchmarks.baseline import Timing, measure, naive_line_of_sight, naive_smart_iteration
from processing.benchmarks.chain import chain_speeds, instruction_set
from processing.benchmarks.scene import Image, SpeedStudy, spray_images, study_cameras
from processing.benchmarks.targets import Measured
from processing.geometry import PinholeCamera
from processing.kernels import _native
from processing.reconstruction.choices import Accuracy, ReconstructionMethod
from processing.reconstruction.line_of_sight import line_of_sight
from processing.reconstruction.planning.node_view import sample_mapping
from processing.reconstruction.planning.plan import MAX_DEVIATION_PX, Plan, plan_reconstruction
from processing.reconstruction.smart import smart
from processing.volume import VoxelGrid


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
    targets: tuple[Measured, ...]


KERNEL_TARGETS = {
    "mlos float16 dense": targets.MLOS_DENSE,
    "mlos float16": targets.MLOS_CULLED,
    "mlos float16 exact": targets.SAMPLED,
    "mlos float16 avx2 dense": targets.AVX2_MLOS,
    "mlos float16 slice": targets.SLICE,
    "mlos float16 256^3": targets.REGION,
}
"""Lines of the table that are one kernel each."""


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
    measured = [_against_target(kernel) for kernel in kernels if kernel.name in KERNEL_TARGETS]
    for one in chain_speeds(study, cameras):
        progress(f"{one.target.work}: {one.value:.3g} {one.target.unit}")
        measured.append(one)
    return SpeedResult(
        isa=_native.selected_isa(),
        volume=study.shape,
        views=len(cameras),
        naive_mlos_cpu_s=naive_mlos_cpu_s,
        naive_smart_iteration_cpu_s=naive_smart_cpu_s,
        kernels=tuple(kernels),
        targets=tuple(measured),
    )


def _against_target(kernel: KernelSpeed) -> Measured:
    target, timing = KERNEL_TARGETS[kernel.name], Timing(kernel.wall_s, kernel.cpu_s)
    return Measured(target, kernel.ratio_to_naive if target.unit == "x" else 1e3 * kernel.wall_s, timing)


def _kernels(
    study: SpeedStudy, cameras: Sequence[PinholeCamera], images: Sequence[Image], mlos_cpu_s: float, smart_cpu_s: float
) -> Iterator[tuple[str, float, Timing]]:
    """Name, baseline and timing of every kernel; volumes are reused, so that their memory is warm."""
    plan = plan_reconstruction(cameras, study.grid)
    volume = np.zeros(study.shape, np.float16)
    by_sight = _by_sight(plan, images, study.threads)
    yield "resample", mlos_cpu_s, measure(lambda: plan.resample(images), study.repeats)
    for method in (ReconstructionMethod.MLOS, ReconstructionMethod.MINLOS, ReconstructionMethod.GAVLOS):
        timing = measure(partial(by_sight, method, out=volume), study.repeats)
        yield f"{method.value} float16", mlos_cpu_s, timing
    yield "mlos float16 dense", mlos_cpu_s, measure(partial(_dense, plan, images, volume, study.threads), study.repeats)
    if "avx2" in _native.available_isas():
        with instruction_set("avx2"):
            yield "mlos float16 avx2", mlos_cpu_s, measure(partial(by_sight, out=volume), study.repeats)
            dense = partial(_dense, plan, images, volume, study.threads)
            yield "mlos float16 avx2 dense", mlos_cpu_s, measure(dense, study.repeats)
    for name, other in _other_plans(study, cameras):
        work = partial(_by_sight(other, images, study.threads), out=volume)
        yield f"mlos float16 {name}", mlos_cpu_s, measure(work, study.repeats)
    yield "smart iteration float16", smart_cpu_s, _smart_iteration(study, plan, images, volume)
    for name, grid in _parts(study.grid):
        part, out = plan_reconstruction(cameras, grid), np.zeros(grid.shape, np.float16)
        work = partial(_by_sight(part, images, study.threads), out=out)
        yield f"mlos float16 {name}", mlos_cpu_s * out.size / volume.size, measure(work, study.repeats)
    del volume
    single = np.zeros(study.shape, np.float32)
    yield "mlos float32", mlos_cpu_s, measure(partial(by_sight, out=single), study.repeats)


def _by_sight(plan: Plan, images: Sequence[Image], threads: int) -> Callable[..., NDArray[np.float16]]:
    return partial(line_of_sight, plan, images, resampled=plan.empty_images(), threads=threads)


def _dense(plan: Plan, images: Sequence[Image], out: NDArray[np.float16], threads: int) -> None:
    """MLOS of every block, empty or not."""
    views = plan.bind(plan.resample(images, threads), cull=False)
    _native.line_of_sight(views, ReconstructionMethod.MLOS, out, threads)


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

    smart(plan, images, iterations=1 + study.repeats, stop=note, out=out, threads=study.threads)
    wall_s, cpu_s = np.median(np.diff(times, axis=0), axis=0)
    return Timing(float(wall_s), float(cpu_s))
