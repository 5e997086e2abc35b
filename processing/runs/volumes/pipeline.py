"""Shots + a calibration + settings -> volumes on disk. Every shot by itself, whoever asks for it."""

import json
import resource
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TypedDict, Unpack

from daq.files.run_directory import RunReader
from processing.kernels import DEFAULT_THREADS
from processing.reconstruction.planning.calibrated_plan import told_coarse
from processing.reconstruction.reconstructor import Reconstructor
from processing.reconstruction.settings import METHOD_VERSION, GridSettings, ReconstructionSettings
from processing.reconstruction.slab_volume import SlabVolume
from processing.reconstruction.volume_file import write_slabs
from processing.runs.errors import Stopped
from processing.runs.recipe import recipe_sha256
from processing.runs.results_file import Provenance, claim_results, volume_path
from processing.runs.shots.clocked_slabs import ClockedSlabs
from processing.runs.shots.lanes import in_lanes
from processing.runs.shots.meetings import MEETING
from processing.runs.shots.shot_light import LIGHT_SHARE
from processing.runs.shots.shot_result import ShotResult, VolumeRecord
from processing.runs.volumes.chain import Chain, Exposure
from processing.runs.workbench import Workbench
from processing.volume import VoxelGrid

Keep = Callable[[Path, SlabVolume, VoxelGrid, Provenance], None]
"""Takes the slabs of a volume as they are made: its file, or what stands for it."""


class Options(TypedDict, total=False):
    """What the values of volumes do not depend on.

    Parameters
    ----------
    workbench : Workbench
        For shot after shot: volumes come earlier.
    threads : int
        That work side by side.
    told : callable
        What else is known of a shot, for its volumes; asked once there is something to write.
    keep : Keep
        What is kept of a volume; all of it by default, as VTKHDF.
    """

    workbench: Workbench
    threads: int
    told: Callable[[], Provenance]
    keep: Keep


def reconstruct_shot(
    run_dir: Path,
    shot: int,
    calibration_file: Path,
    settings: ReconstructionSettings,
    results_dir: Path,
    should_stop: Callable[[], bool] = lambda: False,
    **options: Unpack[Options],
) -> ShotResult:
    """Reconstruct every exposure of one shot, as ``reconstruct_shots`` does."""
    (result,) = reconstruct_shots(run_dir, [shot], calibration_file, settings, results_dir, should_stop, **options)
    return result


def reconstruct_shots(
    run_dir: Path,
    shots: Sequence[int],
    calibration_file: Path,
    settings: ReconstructionSettings,
    results_dir: Path,
    should_stop: Callable[[], bool] = lambda: False,
    **options: Unpack[Options],
) -> Generator[ShotResult, None, None]:
    """Reconstruct every exposure of some shots; two shots side by side where there are two threads.

    The images of one exposure are made while that before it is reconstructed.

    Parameters
    ----------
    run_dir : Path
        The recorded run.
    shots : sequence of int
        Their indices.
    calibration_file : Path
        Calibration of the views of the run.
    settings : ReconstructionSettings
        Method, grid and preprocessing.
    results_dir : Path
        Receives the volumes; a volume of the same shot and settings is replaced atomically.
    should_stop : callable
        Asked between the steps.
    **options
        See ``Options``.

    Raises
    ------
    PipelineError
        A shot is not valid, or run and calibration do not belong together.
    CalibrationError
        The calibration was refused.
    ReconstructionError
        Its views see too little in common, or are too few.
    Stopped
        ``should_stop`` said so.
    """
    threads = options.get("threads", DEFAULT_THREADS)
    keep = options.get("keep", write_slabs)
    told = options.get("told", dict)
    started_cpu_s = time.process_time()
    with (options.get("workbench") or Workbench()).occupied() as bench, RunReader(run_dir) as run:
        chain = Chain.of(run, calibration_file, settings, bench, threads=threads, shots=len(shots))

        def volumes_of(lane: Reconstructor, shot: int) -> list[VolumeRecord]:
            volumes = []
            for exposure in chain.exposures(lane, shot):
                if should_stop():
                    raise Stopped(f"{run_dir.name}, shot {exposure.shot}: stopped before exposure {exposure.frame}")
                with chain.writing:  # whoever is first makes the folder, and has told what is known for all
                    claim_results(results_dir, chain.provenance)
                    known = told()
                volumes.append(_reconstruct(chain, lane, exposure, results_dir, known, keep))
            return volumes

        with closing(in_lanes(shots, chain.lanes, volumes_of)) as coming:
            for volumes in coming:
                yield _result(chain, volumes, time.process_time() - started_cpu_s)
                started_cpu_s = time.process_time()


def _reconstruct(
    chain: Chain, lane: Reconstructor, exposure: Exposure, results_dir: Path, told: Provenance, keep: Keep
) -> VolumeRecord:
    """Slabs are kept as they are made; the time of keeping them does not count."""
    started_s = time.perf_counter()
    volume, residuals = lane.reconstruct(exposure.images)
    begun_s = time.perf_counter() - started_s
    slabs = ClockedSlabs(volume.slabs)
    file = volume_path(results_dir, exposure.shot, exposure.frame)
    convergence = {"residuals": json.dumps(residuals)} if residuals else {}
    named = {**_named(chain, exposure), **told, "shot": exposure.shot, "frame": exposure.frame, **convergence}
    keep(file, replace(volume, slabs=slabs), chain.grid, named)
    record = VolumeRecord(
        shot=exposure.shot,
        frame=exposure.frame,
        file=file.name,
        seconds=round(begun_s + slabs.seconds, 4),
        residuals=residuals,
        empty=slabs.empty,
        lost_share=volume.losses.intensity_share if volume.losses else 0.0,
    )
    return record.model_copy(update={**exposure.faults, "meeting": exposure.meeting, LIGHT_SHARE: exposure.light})


def _named(chain: Chain, exposure: Exposure) -> Provenance:
    """Where a volume comes from, and what is wrong with its images."""
    found = {name: json.dumps(which) for name, which in exposure.faults.items() if which}
    if exposure.light:
        found[LIGHT_SHARE] = json.dumps(exposure.light)
    if exposure.meeting:
        found[MEETING] = exposure.meeting.model_dump_json()
    return {**chain.provenance, **found, "recipe_sha256": recipe_sha256("reconstruct", METHOD_VERSION, chain.settings)}


def _result(chain: Chain, volumes: Sequence[VolumeRecord], cpu_s: float) -> ShotResult:
    return ShotResult(
        shot=volumes[0].shot,
        method=chain.settings.method,
        grid=GridSettings.of(chain.grid),
        views=chain.views,
        coarse=told_coarse(chain.calibration, chain.grid, tuple(chain.views)),
        volumes=tuple(volumes),
        cpu_s=cpu_s,
        peak_rss_mb=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    )
