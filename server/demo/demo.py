"""The demonstration: the whole chain on the simulated bench, from the target on its stage to volumes and droplets."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from daq.counted import counted
from daq.errors import DaqError
from daq.files.run_directory import RunReader
from daq.run.acquisition import Acquisition
from daq.run.events import RunEvent, RunMessage
from daq.run.state import RunOutcome
from daq.run_notes import RunNotes, Spray
from daq.run_plan import PulsePair, RunKind, RunPlan
from processing.analysis.quality import quality_factor
from processing.analysis.spray.spray_statistics import AskedFor
from processing.calibration.calibrate import calibrate
from processing.calibration.calibration import Calibration
from processing.calibration.calibration_file import file_sha256, save_calibration
from processing.calibration.sets.calibration_set import load_calibration_set
from processing.geometry import FloatArray
from processing.reconstruction.planning.calibrated_plan import default_grid
from processing.reconstruction.settings import GridSettings, ReconstructionSettings
from processing.reconstruction.volume_file import read_volume
from processing.runs.results_file import volume_path
from processing.runs.shots.shot_result import ShotResult
from processing.runs.sprays.measured_spray import read_files
from processing.runs.volumes.pipeline import reconstruct_shot
from processing.runs.workbench import Workbench
from processing.synthetic.liquid.nozzles import HOLLOW_CONE_FLOW
from processing.synthetic.spray import droplet_volume
from processing.synthetic.truth_file import read_true_cameras, read_true_spray
from processing.volume import VoxelGrid
from server.demo.demo_droplets import MeasuredDroplets, measure_droplets
from server.demo.demo_liquid import MeasuredLiquid, measure_liquid
from server.reports.spray_report import ReportedSpray
from server.rig.assembly import AssembledRig, open_rig, recorded_configuration
from server.rig.config import ConfigError, RigConfig, load_config
from server.rig.rig_lock import hold_data_dir
from server.rig.simulated_operator import TRUTH_FILE

STAGE_Z_MM = tuple(float(z) for z in np.linspace(-4.5, 4.5, 10))
PITCH_MM = 1 / 30
RUN_DEADLINE_S = 240.0
CALIBRATION_RATE_HZ, SAMPLE_RATE_HZ = 2.0, 1.0
REFERENCE_SHOTS = 4
NOTES = RunNotes(fluid="water, simulated", nozzle="hollow cone, 63 degrees, orifice 0.2 mm", pressure_bar=6.0)
WATER_KG_M3 = 998.0
"""At 20 degrees: what the simulated nozzle sprays."""
TRUTH_SIGMA_MM = 0.02
"""Blur of the true volume: about the Airy disk in object space, d_A / M = 0.065 to 0.09 mm, as a Gaussian core."""

Progress = Callable[[str], None]


@dataclass
class Stopwatch:
    """Seconds per step."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """Add the time of the block to a step."""
        started_s = time.perf_counter()
        yield
        self.seconds[name] = round(self.seconds.get(name, 0.0) + time.perf_counter() - started_s, 2)


@dataclass(frozen=True)
class Demonstration:
    """All that the demonstration made, for its report."""

    calibration: Calibration
    true_error_px: dict[str, float]
    sample_run: Path
    results: tuple[ShotResult, ...]
    results_dir: Path
    quality_factors: tuple[float, ...]
    droplets: MeasuredDroplets
    liquid: MeasuredLiquid
    spray: ReportedSpray
    shots_planned: int
    shots_recorded: int
    shots_valid: int
    seconds: dict[str, float]


def demonstrate(
    config_file: Path, out: Path, shots: int, progress: Progress, firmware: str | None = None
) -> Demonstration:
    """Calibrate, record references and spray, reconstruct each shot, measure droplets and break-up, ask the truth.

    ``firmware`` stands for the configuration's ``simulation.firmware``.

    Raises
    ------
    ConfigError
        The configuration is wrong, or of a real rig.
    DaqError
        A run did not complete.
    """
    watch = Stopwatch()
    calibration, sample = _recorded(_simulated_rig(config_file, firmware), out, shots, progress, watch)
    recorded, valid = _recorded_and_valid(sample)
    file, grid = calibration_path(out, calibration.id), default_grid(calibration, PITCH_MM)
    settings = ReconstructionSettings(grid=GridSettings.of(grid))
    results_dir = sample / "results" / settings.results_id(calibration.id)
    with watch.step("reconstruct"):
        results = tuple(_reconstructed(sample, valid, file, settings, results_dir, progress))
    with watch.step("measure"):
        droplets, liquid = _measured(sample, valid, calibration, file, progress)
    with watch.step("judge"):
        progress("comparing with the truth")
        measured = read_files([droplets.file])
        spray = ReportedSpray.of(measured, AskedFor(measured.axis, liquid_kg_m3=WATER_KG_M3))
        qualities = tuple(_quality(sample, results_dir, result.shot) for result in results)
    return Demonstration(
        calibration=calibration,
        true_error_px=true_errors_px(calibration, sample, grid),
        sample_run=sample,
        results=results,
        results_dir=results_dir,
        quality_factors=qualities,
        droplets=droplets,
        liquid=liquid,
        spray=spray,
        shots_planned=shots,
        shots_recorded=recorded,
        shots_valid=len(results),
        seconds=watch.seconds,
    )


def _recorded(
    config: RigConfig, out: Path, shots: int, progress: Progress, watch: Stopwatch
) -> tuple[Calibration, Path]:
    """Calibrate, and record references and spray: the calibration, and the run of the spray."""
    with hold_data_dir(out / "runs"), open_rig(config) as assembled:
        recorder = _Runs(config, assembled, out / "runs", progress)
        with watch.step("calibrate"):
            calibration = _calibrate(recorder, out)
        with watch.step("acquire"):
            return calibration, _record_sample(recorder, shots, calibration)


def _measured(
    sample: Path, valid: list[int], calibration: Calibration, file: Path, progress: Progress
) -> tuple[MeasuredDroplets, MeasuredLiquid]:
    """Droplets of the first shot, and liquid that is none in all shots, each beside the truth."""
    progress(f"measuring the droplets of shot {valid[0]} in a box downstream of the break-up")
    droplets = measure_droplets(sample, valid[0], calibration, file, sample / TRUTH_FILE)
    progress("looking for ligaments and the break-up in exposure A of every shot")
    return droplets, measure_liquid(sample, valid, calibration, sample / TRUTH_FILE)


def _simulated_rig(config_file: Path, firmware: str | None) -> RigConfig:
    if not config_file.exists():
        raise ConfigError(
            f"{config_file}: no such file; run the demonstration in a clone of tomoshadow, which has the rig and the "
            "sources of its firmware, or name a simulated rig by --config"
        )
    config = load_config(config_file)
    if config.simulation is None:
        raise ConfigError(f"{config_file}: the demonstration needs a rig with [simulation]")
    if firmware is None:
        return config
    simulation = config.simulation.model_copy(update={"firmware": firmware})
    return config.model_copy(update={"simulation": simulation})


def _calibrate(recorder: "_Runs", out: Path) -> Calibration:
    """Record the target on its stage and calibrate all views."""
    target_run = recorder.record(RunKind.CALIBRATION, 1, CALIBRATION_RATE_HZ, stage_z_mm=STAGE_Z_MM)
    calibration = calibrate(load_calibration_set(target_run))
    file = calibration_path(out, calibration.id)
    file.parent.mkdir(parents=True, exist_ok=True)
    save_calibration(calibration, file)
    return calibration


def _record_sample(recorder: "_Runs", shots: int, calibration: Calibration) -> Path:
    """Record dark and background, then the spray."""
    references = [
        recorder.record(kind, REFERENCE_SHOTS, SAMPLE_RATE_HZ).name for kind in (RunKind.DARK, RunKind.BACKGROUND)
    ]
    return recorder.record(
        RunKind.SAMPLE,
        shots,
        SAMPLE_RATE_HZ,
        references=tuple(references),
        calibration=calibration.id,
        spray=Spray(nozzle_mm=HOLLOW_CONE_FLOW.orifice_mm),
        notes=NOTES,
    )


def calibration_path(out: Path, calibration_id: str) -> Path:
    """Where the demonstration keeps a calibration."""
    return out / "calibrations" / f"{calibration_id}.json"


def true_errors_px(calibration: Calibration, run_dir: Path, grid: VoxelGrid) -> dict[str, float]:
    """Largest distance per view between the calibrated and the true image of any point of the volume."""
    points_mm = _lattice(grid)
    cameras = read_true_cameras(run_dir / TRUTH_FILE)
    return {
        name: float(np.linalg.norm(view.mapping.project(points_mm) - cameras[name].project(points_mm), axis=1).max())
        for name, view in calibration.views.items()
    }


class _Runs:
    """Records the runs of the demonstration one after the other."""

    def __init__(self, config: RigConfig, assembled: AssembledRig, data_dir: Path, progress: Progress) -> None:
        self._data_dir = data_dir
        self._progress = progress
        self._pulse = PulsePair(current_a={name: view.nominal_current_a for name, view in config.views.items()})
        self._acquisition = Acquisition(
            assembled.rig,
            data_dir,
            self._tell,
            configuration=recorded_configuration(config),
            hash_calibration=lambda name: file_sha256(calibration_path(data_dir.parent, name)),
            limits=config.acquisition.to_limits(),
            observers=assembled.observers,
        )

    def _tell(self, event: RunEvent) -> None:
        if isinstance(event, RunMessage):
            self._progress(event.text)

    def record(self, kind: RunKind, shots: int, rate_hz: float, **details: Any) -> Path:
        plan = RunPlan(name=f"demo {kind.value}", kind=kind, shots=shots, rate_hz=rate_hz, pulse=self._pulse, **details)
        self._progress(f"recording {counted(plan.total_shots, f'{kind.value} shot')}")
        run_dir = self._data_dir / self._acquisition.start(plan)
        status = self._acquisition.wait(RUN_DEADLINE_S)
        if status.outcome is not RunOutcome.COMPLETED:
            raise DaqError(f"{run_dir.name}: {status.outcome or status.state}, {status.message}")
        self._progress(f"{run_dir.name}: {status.shots_valid} of {counted(status.shots_planned, 'shot')} valid")
        return run_dir


def _reconstructed(
    sample: Path,
    shots: Sequence[int],
    calibration_file: Path,
    settings: ReconstructionSettings,
    results_dir: Path,
    progress: Progress,
) -> Iterator[ShotResult]:
    """Reconstruct shot after shot, and tell which."""
    workbench = Workbench()
    for shot in shots:
        progress(f"reconstructing shot {shot} by {settings.method.value}")
        yield reconstruct_shot(sample, shot, calibration_file, settings, results_dir, workbench=workbench)


def _recorded_and_valid(run_dir: Path) -> tuple[int, list[int]]:
    """Number of recorded shots, and which of them are good.

    Raises
    ------
    DaqError
        None is.
    """
    with RunReader(run_dir) as run:
        recorded, valid = run.shot_count, [index for index in range(run.shot_count) if run.read_shot(index).valid]
    if not valid:
        raise DaqError(f"{run_dir.name}: no shot of {recorded} is valid, nothing to reconstruct")
    return recorded, valid


def _quality(run_dir: Path, results_dir: Path, shot: int) -> float:
    """Quality factor c_II of exposure A against the spray that was really there."""
    with RunReader(run_dir) as run:
        fired = run.read_shot(shot).fired
    if fired is None:
        raise DaqError(f"{run_dir.name}, shot {shot}: names no firing")
    volume, grid, _ = read_volume(volume_path(results_dir, shot, "a"))
    spray = read_true_spray(run_dir / TRUTH_FILE, fired.sequence).spray
    return quality_factor(droplet_volume(spray, grid, TRUTH_SIGMA_MM), volume)


def _lattice(grid: VoxelGrid) -> FloatArray:
    axes_mm = (np.linspace(axis_mm[0], axis_mm[-1], 15) for axis_mm in (grid.x_mm, grid.y_mm, grid.z_mm))
    return np.stack(np.meshgrid(*axes_mm, indexing="ij"), axis=-1).reshape(-1, 3)
