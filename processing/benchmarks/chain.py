"""What of the speed study is more than one kernel: from raw images, to the end of SMART, of many exposures, memory."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import cycle, islice

import numpy as np
from numpy.typing import NDArray

from processing.benchmarks import targets
from processing.benchmarks.baseline import Timing, measure, measure_once
from processing.benchmarks.memory import peak_memory_gb
from processing.benchmarks.scene import (
    Image,
    RawExposure,
    SpeedStudy,
    dense_images,
    raw_exposures,
    sparse_images,
    spray_images,
)
from processing.benchmarks.targets import Measured, Target
from processing.geometry import PinholeCamera
from processing.kernels import _native
from processing.preprocessing import Preprocessing, intensity, sliding_minimum
from processing.reconstruction.line_of_sight import line_of_sight
from processing.reconstruction.mean_line_of_sight import mean_line_of_sight
from processing.reconstruction.planning.plan import Plan, plan_reconstruction
from processing.reconstruction.smart import SmartResult, smart

Volume = NDArray[np.float16]

SETTINGS = Preprocessing()
DISTINCT_EXPOSURES = 8
"""Of the many in a mean; they repeat."""


def chain_speeds(study: SpeedStudy, cameras: Sequence[PinholeCamera]) -> Iterator[Measured]:
    """Measure them, one after the other; memory of images and volumes is warm."""
    plan = plan_reconstruction(cameras, study.grid)
    volumes = [np.zeros(study.shape, np.float16) for _ in "ab"]
    yield from _from_raw_images(study, cameras, plan, volumes)
    yield from _by_smart(study, cameras, plan, volumes)
    del volumes
    yield _of_many(study, cameras, plan)
    yield Measured(targets.VOLUME_MEMORY, peak_memory_gb("volume", study))
    yield Measured(targets.SLABS_MEMORY, peak_memory_gb("slabs", study))
    yield Measured(targets.SMART_MEMORY, peak_memory_gb("smart", study))


@contextmanager
def instruction_set(name: str) -> Iterator[None]:
    """Let the kernels use no more than this instruction set."""
    before = os.environ.get("TOMOSHADOW_ISA")
    os.environ["TOMOSHADOW_ISA"] = name
    try:
        yield
    finally:
        if before is None:
            del os.environ["TOMOSHADOW_ISA"]
        else:
            os.environ["TOMOSHADOW_ISA"] = before


def _from_raw_images(
    study: SpeedStudy, cameras: Sequence[PinholeCamera], plan: Plan, volumes: Sequence[Volume]
) -> Iterator[Measured]:
    sprays = [spray_images(study, cameras, seed) for seed in (1, 2)]
    images, resampled = [np.zeros_like(image) for image in sprays[0]], plan.empty_images()
    timing = Timing(0.0, 1.0)
    for bits, target in targets.DOUBLE_EXPOSURE.items():
        raw = [raw_exposures(spray, bits) for spray in sprays]
        work = partial(_reconstruct_raw, plan, raw, images, resampled, volumes, study.threads)
        timing = measure(work, study.repeats)
        yield _in_seconds(target, timing)

    def minima() -> None:
        for spray in sprays:
            for image, least in zip(spray, images, strict=True):
                sliding_minimum(image, SETTINGS.minimum_window_px, least, threads=study.threads)

    share = measure(minima, study.repeats).cpu_s / timing.cpu_s
    yield Measured(targets.SLIDING_MINIMUM, 100 * share, how=f"{SETTINGS.minimum_window_px} px")


def _reconstruct_raw(
    plan: Plan,
    raw: Sequence[Sequence[RawExposure]],
    images: Sequence[Image],
    resampled: Sequence[NDArray[np.int16]],
    volumes: Sequence[Volume],
    threads: int,
) -> None:
    for exposures, volume in zip(raw, volumes, strict=True):
        for exposure, image in zip(exposures, images, strict=True):
            intensity(
                exposure.frame,
                SETTINGS,
                bits=exposure.bits,
                dark=exposure.dark,
                background=exposure.background,
                out=image,
                threads=threads,
            )
        line_of_sight(plan, images, out=volume, resampled=resampled, threads=threads)


def _by_smart(
    study: SpeedStudy, cameras: Sequence[PinholeCamera], plan: Plan, volumes: Sequence[Volume]
) -> Iterator[Measured]:
    def timing(sprays: Sequence[Sequence[Image]]) -> Timing:
        warm = smart(plan, sprays[0], iterations=1, threads=study.threads)
        return measure_once(partial(_refine, study, plan, sprays, volumes, warm))

    iterations = f"{study.iterations} iterations"
    dense, sparse = ([draw(study, cameras, seed) for seed in (1, 2)] for draw in (dense_images, sparse_images))
    yield _in_seconds(targets.SMART_DENSE, timing(dense), iterations)
    occupied = np.mean([np.count_nonzero(line_of_sight(plan, images, out=volumes[0])) for images in sparse])
    occupancy = f"{iterations}, {100 * occupied / volumes[0].size:.1f} % of the voxels"
    yield _in_seconds(targets.SMART_SPARSE, timing(sparse), occupancy)
    if "avx2" in _native.available_isas():
        with instruction_set("avx2"):
            yield _in_seconds(targets.AVX2_SMART, timing(dense), iterations)


def _refine(
    study: SpeedStudy, plan: Plan, sprays: Sequence[Sequence[Image]], volumes: Sequence[Volume], memory: SmartResult
) -> None:
    for images, volume in zip(sprays, volumes, strict=True):
        memory = smart(plan, images, iterations=study.iterations, out=volume, memory=memory, threads=study.threads)


def _of_many(study: SpeedStudy, cameras: Sequence[PinholeCamera], plan: Plan) -> Measured:
    sprays = [spray_images(study, cameras, seed) for seed in range(DISTINCT_EXPOSURES)]
    mean = np.zeros(study.shape, np.float32)
    exposures = islice(cycle(sprays), study.mean_exposures)
    timing = measure_once(lambda: mean_line_of_sight(plan, exposures, out=mean, threads=study.threads))
    return _in_seconds(targets.MEAN, timing, f"{study.mean_exposures}")


def _in_seconds(target: Target, timing: Timing, how: str = "") -> Measured:
    return Measured(target, timing.wall_s, timing, how)
