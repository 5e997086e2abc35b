"""Droplets of the demonstration: a box downstream of the break-up is measured in one shot, and judged by the truth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from daq.files.run_directory import RunReader
from processing.analysis.droplets.droplet_file import StoredDroplets, read_droplets
from processing.analysis.droplets.droplet_statistics import DropletStatistics, droplet_statistics
from processing.analysis.droplets.ghost_share import RADIUS_VOXEL, matches
from processing.analysis.spray.spray_sample import SpraySample, bounds_mm
from processing.calibration.calibration import Calibration
from processing.figures.found_figures import Placed
from processing.geometry import FloatArray
from processing.reconstruction.planning.calibrated_plan import default_grid
from processing.reconstruction.settings import GridSettings
from processing.runs.droplets.measure_settings import MeasureSettings
from processing.runs.droplets.measured_shot import ShotDroplets
from processing.runs.droplets.measurement import RunMeasurement
from processing.synthetic.spray import LiquidKind, Spray
from processing.synthetic.truth_file import read_true_spray
from processing.volume import VoxelGrid

HALF_WIDTH_MM, TOP_MM, BOTTOM_MM = 5.8, -1.1, -0.4
"""Of the box, in x and z as wide as the cone and the droplets around it; the sheet ends 3 mm above."""
COUNTED_UM = 30.0
"""Droplets found and ghosts are counted from this diameter on."""
EXPOSURES = 2
"""Of the shot whose droplets are measured."""


@dataclass(frozen=True)
class JudgedVelocities:
    """Velocities of true droplets.

    Parameters
    ----------
    mean_m_s, true_mean_m_s : tuple of 3 float
        Of the same droplets, as measured and in truth.
    rms_m_s : float
        Root mean square error of a component.
    """

    mean_m_s: tuple[float, float, float]
    true_mean_m_s: tuple[float, float, float]
    rms_m_s: float


@dataclass(frozen=True, eq=False)
class MeasuredDroplets:
    """What a shot says of the spray, and the truth.

    Parameters
    ----------
    file : Path
        Droplets of both exposures.
    shot : ShotDroplets
        What became of it.
    stored : StoredDroplets
        The droplets.
    statistics : DropletStatistics
        Of both exposures.
    found, missed, ghosts : Placed
        True droplets of both exposures that were found, true ones that were not, and found ones that are none; from
        ``COUNTED_UM`` on. Droplets that liquid hides count as missed.
    truth : SpraySample
        All true droplets in the box, of both exposures.
    velocities : JudgedVelocities | None
        Against the truth; None without velocities.
    """

    file: Path
    shot: ShotDroplets
    stored: StoredDroplets
    statistics: DropletStatistics
    found: Placed
    missed: Placed
    ghosts: Placed
    truth: SpraySample
    velocities: JudgedVelocities | None

    @property
    def found_share(self) -> float:
        """Of the true droplets."""
        return len(self.found) / max(len(self.found) + len(self.missed), 1)

    @property
    def true_d32_um(self) -> float:
        """Of all true droplets in the box."""
        return float(np.sum(self.truth.cubes_um3) / np.sum(self.truth.diameters_um**2))

    @property
    def true_density_per_mm3(self) -> float:
        """Of the same, mean of both exposures."""
        return len(self.truth) / float(self.truth.volumes_mm3.sum())

    @property
    def ghost_share(self) -> float:
        """Of the droplets that were found."""
        return len(self.ghosts) / max(len(self.found) + len(self.ghosts), 1)


def measured_box(calibration: Calibration) -> VoxelGrid:
    """The box, one voxel per pixel."""
    pitch_mm = default_grid(calibration).pitch_mm
    nx, ny = (round(length_mm / pitch_mm) for length_mm in (2 * HALF_WIDTH_MM, BOTTOM_MM - TOP_MM))
    return VoxelGrid((nx, ny, nx), (-HALF_WIDTH_MM, TOP_MM, -HALF_WIDTH_MM), pitch_mm)


def measure_droplets(
    run_dir: Path, shot: int, calibration: Calibration, calibration_file: Path, truth_file: Path
) -> MeasuredDroplets:
    """Measure the box in both exposures of a shot, and compare with the truth."""
    grid = measured_box(calibration)
    settings = MeasureSettings(polarity="shadow", grid=GridSettings.of(grid))
    results_dir = run_dir / "results" / settings.results_id(calibration.id)
    with RunReader(run_dir) as run:
        told = RunMeasurement.of(run, shot, calibration_file, settings).measure(shot, results_dir).summary
        sprays = true_sprays(run, shot, truth_file)
    stored = read_droplets(results_dir / told.file)
    found, missed, ghosts = zip(*(_judged(stored, frame, spray, grid) for frame, spray in sprays.items()), strict=True)
    return MeasuredDroplets(
        file=results_dir / told.file,
        shot=told,
        stored=stored,
        statistics=droplet_statistics([stored]),
        found=_joined(found),
        missed=_joined(missed),
        ghosts=_joined(ghosts),
        truth=true_sample(list(sprays.values()), grid),
        velocities=_judged_velocities(stored, sprays["a"], grid),
    )


def true_sprays(run: RunReader, shot: int, truth_file: Path) -> Mapping[str, Spray]:
    """The liquid of both exposures: that of A is on file, and flies on until the second pulse."""
    fired = run.read_shot(shot).fired
    if fired is None:
        raise ValueError(f"shot {shot} names no firing")
    first, second = next(iter(fired.pulses.values()))
    spray = read_true_spray(truth_file, fired.sequence).spray
    return {"a": spray, "b": spray.advanced(1e-9 * (second.start_ns - first.start_ns))}


def true_sample(exposures: Sequence[Spray], grid: VoxelGrid) -> SpraySample:
    """All droplets of one shot that are in a box, as if each had been measured without error."""
    within = [_droplets(spray).inside(grid) for spray in exposures]
    diameters_um = 1000 * np.concatenate([one.diameters_mm for one in within])
    return SpraySample(
        diameters_um=diameters_um,
        points_mm=np.concatenate([one.positions_mm for one in within]),
        velocities_m_s=np.concatenate([one.velocities_mm_per_s for one in within]) / 1000,
        shot=np.zeros(len(diameters_um), np.intp),
        volumes_mm3=np.array([len(within) * float(np.prod(grid.shape)) * grid.pitch_mm**3]),
        exposures_per_shot=len(within),
        box_mm=bounds_mm(grid),
    )


def _droplets(spray: Spray) -> Spray:
    return spray.of_kind(LiquidKind.DROPLET)


def _judged(stored: StoredDroplets, frame: str, spray: Spray, grid: VoxelGrid) -> tuple[Placed, Placed, Placed]:
    """Found and missed true droplets, and ghosts."""
    columns = {name: column[stored.columns["frame"] == frame] for name, column in stored.columns.items()}
    told = Placed(
        np.column_stack([columns[f"{axis}_mm"] for axis in "xyz"]), np.asarray(columns["diameter_um"], np.float64)
    )
    truth, within, radius_mm = _droplets(spray), _droplets(spray).inside(grid), RADIUS_VOXEL * grid.pitch_mm
    ghost = matches(told.points_mm, truth.positions_mm, radius_mm)[0] < 0
    missed = matches(told.points_mm, within.positions_mm, radius_mm)[1] < 0
    true = Placed(within.positions_mm, 1000 * within.diameters_mm)
    return _counted(true, ~missed), _counted(true, missed), _counted(told, ghost)


def _judged_velocities(stored: StoredDroplets, spray: Spray, grid: VoxelGrid) -> JudgedVelocities | None:
    """Of droplets of A that have a velocity and are true ones."""
    if "u_m_s" not in stored.columns:
        return None
    first, truth = stored.columns["frame"] == "a", _droplets(spray)
    points_mm, velocities_m_s = (
        np.column_stack([np.asarray(stored.columns[name], np.float64)[first] for name in names])
        for names in (("x_mm", "y_mm", "z_mm"), ("u_m_s", "v_m_s", "w_m_s"))
    )
    match = matches(points_mm, truth.positions_mm, RADIUS_VOXEL * grid.pitch_mm)[0]
    judged = (match >= 0) & np.isfinite(velocities_m_s[:, 0])
    if not judged.any():
        return None
    told_m_s, true_m_s = velocities_m_s[judged], truth.velocities_mm_per_s[match[judged]] / 1000
    return JudgedVelocities(_mean(told_m_s), _mean(true_m_s), float(np.sqrt(np.mean((told_m_s - true_m_s) ** 2))))


def _mean(velocities_m_s: FloatArray) -> tuple[float, float, float]:
    u, v, w = (float(one) for one in velocities_m_s.mean(0))
    return u, v, w


def _counted(droplets: Placed, chosen: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> Placed:
    counted = chosen & (droplets.diameters_um > COUNTED_UM)
    return Placed(droplets.points_mm[counted], droplets.diameters_um[counted])


def _joined(parts: tuple[Placed, ...]) -> Placed:
    return Placed(
        np.concatenate([part.points_mm for part in parts]), np.concatenate([part.diameters_um for part in parts])
    )
