"""The work functions of jobs: they run in worker processes, on paths and JSON values."""

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from types import MappingProxyType
from typing import Any

from daq.files.run_directory import RunReader
from processing.analysis.near_or_far import SIGHTS
from processing.calibration.calibrate import calibrate
from processing.calibration.calibration_file import file_sha256, load_calibration, save_calibration
from processing.calibration.sets.calibration_set import load_calibration_set
from processing.calibration.verdict import BELONGING
from processing.kernels import DEFAULT_THREADS
from processing.reconstruction.settings import ReconstructionSettings
from processing.reconstruction.volume_file import write_slabs
from processing.runs.droplets.measure_settings import MeasureSettings
from processing.runs.droplets.measurement import RunMeasurement
from processing.runs.run_check import check_shot
from processing.runs.volumes.pipeline import Keep, reconstruct_shot
from processing.runs.workbench import Workbench
from server.lab.engine.task import Task
from server.lab.jobs.job import JobKind
from server.lab.results import keep_preview, keep_volume

_KEEPS: Mapping[str, Keep] = {"preview": keep_preview, "volume": keep_volume, "volume alone": write_slabs}
WORKBENCH = Workbench()
"""Of this worker process, which does one job at a time."""


def reconstruct(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
    """Reconstruct one shot; a preview is kept of each volume, or what else the job says under ``keep``."""
    result = reconstruct_shot(
        Path(job["run_dir"]),
        job["shot"],
        Path(job["calibration_file"]),
        ReconstructionSettings.model_validate(job["settings"]),
        Path(job["results_dir"]),
        should_stop,
        workbench=WORKBENCH,
        threads=_threads(job),
        told=lambda: {BELONGING: json.dumps(job[BELONGING])} if job.get(BELONGING) else {},
        keep=_KEEPS[job.get("keep", "preview")],
    )
    return result.model_dump(mode="json")


def measure_shot(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
    """Measure the droplets of one shot; no volume is needed."""
    settings, calibration_file = MeasureSettings.model_validate(job["settings"]), Path(job["calibration_file"])
    with WORKBENCH.occupied() as bench, RunReader(Path(job["run_dir"])) as run:
        measurement = bench.planned(
            run,
            (calibration_file, file_sha256(calibration_file), settings),
            lambda: RunMeasurement.of(run, job["shot"], calibration_file, settings, bench.references(run)),
        )
        measured = measurement.measure(job["shot"], Path(job["results_dir"]), _threads(job), should_stop)
    return measured.summary.model_dump(mode="json")


def calibrate_run(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
    """Fit all views to the shots of a calibration run, and draw what it says."""
    from server.pictures.calibration_pictures import store_pictures  # its library of figures is large

    calibration_set = load_calibration_set(Path(job["run_dir"]))
    should_stop()
    calibration = calibrate(calibration_set, model=job["settings"]["model"])
    out = Path(job["calibration_file"])
    save_calibration(calibration, out)
    store_pictures(Path(job["run_dir"]), calibration_set, calibration, out.parent / "pictures" / out.stem)
    return {
        "calibration": calibration.id,
        "views": {
            name: {
                "mean_error_px": view.mean_error_px,
                "holdout_error_px": view.holdout_error_px,
                "verdict": view.verdict,
                "reasons": list(view.reasons),
                "n_rejected": view.n_rejected,
            }
            for name, view in calibration.views.items()
        },
        "not_checked": [asdict(one) for one in calibration.not_checked],
    }


def check_run(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
    """Measure how well the calibration still fits one shot."""
    calibration = load_calibration(Path(job["calibration_file"]))
    should_stop()
    checked = check_shot(Path(job["run_dir"]), job["shot"], calibration, WORKBENCH)
    return {**checked.record(), SIGHTS: dict(checked.sights)}


def _threads(job: Mapping[str, Any]) -> int:
    """A worker that has a computer to itself says how many."""
    return int(job.get("threads", DEFAULT_THREADS))


TASKS: Mapping[JobKind, Task] = MappingProxyType(
    {
        JobKind.RECONSTRUCTION: reconstruct,
        JobKind.MEASUREMENT: measure_shot,
        JobKind.CALIBRATION: calibrate_run,
        JobKind.CHECK: check_run,
    }
)
"""Work function of every kind of job."""
