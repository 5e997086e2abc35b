"""Droplets found and ghosts when images are explained by droplets: the measuring of droplets against known truth.

The truth has no part in it: images are drawn by ``processing.synthetic`` along the cameras' own lines of sight.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from processing.analysis.droplets.bright_shot import measure_bright
from processing.analysis.droplets.droplet_search import MARGIN_VOXEL, plan_droplets
from processing.analysis.droplets.droplet_table import Droplets, SizedDroplets
from processing.analysis.droplets.ghost_share import RADIUS_VOXEL, matches
from processing.figures.droplet_figures import MeasuredCase, droplets_figure
from processing.geometry import FloatArray, PinholeCamera
from processing.kernels import DEFAULT_THREADS
from processing.studies.report import Statement, grouped, shares_asked, shares_told
from processing.studies.sensitivity import misaligned, spread_cameras
from processing.studies.simulated_droplets import Image, droplet_centres, study_grid
from processing.synthetic.bright_particles import spots_image
from processing.synthetic.paper_rig import TABLE_1
from processing.volume import VoxelGrid

AMPLITUDE_SPREAD = 0.5
"""Standard deviation of the logarithm of the amplitudes, whose median is 1."""
SLAB = (250, 100, 500)
"""The full depth of the paper's volume."""
IMAGE_SIZE_PX = (600, 160)


@dataclass(frozen=True)
class DropletCase:
    """What to simulate, and what is asked for.

    Parameters
    ----------
    density_per_mm3 : float
        Of the droplets.
    sigma_px : float
        Width of their images.
    noise_percent : float
        Of the median amplitude.
    views : int
        The paper's four, or another number spread over the same angles.
    calibration_error_px : float
        By which each view lies beside its calibration, in a direction of its own.
    least_found, most_ghosts : float | None
        Shares that the mean of the shots must keep.
    """

    density_per_mm3: float = 28.0
    sigma_px: float = 1.0
    noise_percent: float = 3.0
    views: int = len(TABLE_1)
    calibration_error_px: float = 0.0
    least_found: float | None = None
    most_ghosts: float | None = None

    @property
    def name(self) -> str:
        """For tables and figures."""
        parts = [f"{self.density_per_mm3:g}/mm³", f"sigma {self.sigma_px:g}", f"noise {self.noise_percent:g} %"]
        if self.views != len(TABLE_1):
            parts.append(f"{self.views} views")
        if self.calibration_error_px:
            parts.append(f"calibration {self.calibration_error_px:g} px off")
        return ", ".join(parts)


ASKED_FOR = (
    DropletCase(14, least_found=0.995, most_ghosts=0.003),
    DropletCase(28, least_found=0.99, most_ghosts=0.005),
    DropletCase(56, least_found=0.985, most_ghosts=0.005),
    DropletCase(28, 1.5, least_found=0.985, most_ghosts=0.005),
    DropletCase(56, 1.5, least_found=0.96, most_ghosts=0.02),
    DropletCase(28, calibration_error_px=0.1, least_found=0.99, most_ghosts=0.005),
    DropletCase(56, calibration_error_px=0.1, least_found=0.98, most_ghosts=0.005),
)


@dataclass(frozen=True)
class DropletStudy:
    """Which cases, and how often.

    Parameters
    ----------
    cases : tuple of DropletCase
        What to simulate.
    seeds : tuple of int
        One shot each.
    shape : tuple[int, int, int]
        Voxels (nz, ny, nx) at 60 voxel/mm.
    image_size_px : tuple[int, int]
        (width, height) of every view.
    margin_voxel : int
        So far around the slab droplets are looked for.
    twins : int
        Of every shot.
    """

    cases: tuple[DropletCase, ...] = ASKED_FOR
    seeds: tuple[int, ...] = (301, 302, 303, 304, 305)
    shape: tuple[int, int, int] = SLAB
    image_size_px: tuple[int, int] = IMAGE_SIZE_PX
    margin_voxel: int = MARGIN_VOXEL
    twins: int = 0


@dataclass(frozen=True)
class DropletRow:
    """One shot: found (share of the droplets), ghosts (share of what was found), and how exact.

    ``rms_voxel`` is that of a coordinate once a common motion of all, which a wrong calibration makes, is taken out;
    ``z_sd`` the robust standard deviation of errors over what their covariance says.
    """

    case: str
    seed: int
    droplets: int
    found: float
    ghosts: float
    rms_voxel: float
    z_sd: float
    residual_over_noise: float
    verdict: str
    twin_ghosts: float | None
    cpu_ms_per_droplet: float
    least_found: float | None
    most_ghosts: float | None


@dataclass(frozen=True, eq=False)
class BrightScene:
    """A simulated shot of bright particles.

    Parameters
    ----------
    points_mm : (N, 3) array
        Where they are.
    heights : (N,) array
        Of their images.
    images : list of (rows, columns) float32 arrays
        One per camera.
    believed : list of PinholeCamera
        What the calibration takes the cameras for.
    """

    points_mm: FloatArray
    heights: FloatArray
    images: list[Image]
    believed: list[PinholeCamera]


def droplet_study(study: DropletStudy | None = None, threads: int = DEFAULT_THREADS) -> Iterator[DropletRow]:
    """Simulate, measure and compare, shot by shot. The same study gives the same shares; times differ."""
    study = study or DropletStudy()
    for case in study.cases:
        for seed in study.seeds:
            yield _row(study, case, seed, threads)


def bright_scene(
    case: DropletCase, grid: VoxelGrid, image_size_px: tuple[int, int], rng: np.random.Generator
) -> BrightScene:
    """A shot of a case: droplets all over a grid, uniformly."""
    cameras = spread_cameras(case.views, image_size_px)
    count = round(case.density_per_mm3 * grid.volume_mm3)
    points_mm = grid.to_mm(droplet_centres(grid.shape, count, rng))
    heights = rng.lognormal(0, AMPLITUDE_SPREAD, count)
    images = bright_images(case, cameras, points_mm, heights, rng)
    believed = [misaligned(camera, case.calibration_error_px, rng) for camera in cameras]
    return BrightScene(points_mm, heights, images, believed)


def bright_images(
    case: DropletCase,
    cameras: Sequence[PinholeCamera],
    points_mm: FloatArray,
    heights: FloatArray,
    rng: np.random.Generator,
) -> list[Image]:
    """What cameras see of bright particles at places (N, 3) and of heights (N,), with noise."""
    drawn = [spots_image(camera, points_mm, heights, case.sigma_px) for camera in cameras]
    return [(image + rng.normal(0, case.noise_percent / 100, image.shape)).astype(np.float32) for image in drawn]


def _row(study: DropletStudy, case: DropletCase, seed: int, threads: int) -> DropletRow:
    grid = study_grid(study.shape)
    scene = bright_scene(case, grid, study.image_size_px, np.random.default_rng(seed))
    started_cpu_s = time.process_time()
    search = plan_droplets(scene.believed, grid, margin_voxel=study.margin_voxel)
    shot = measure_bright(scene.images, search, twins=study.twins, seed=seed, threads=threads)
    cpu_s = (time.process_time() - started_cpu_s) / (1 + study.twins)
    found, missed = matches(shot.droplets.points_mm, scene.points_mm, RADIUS_VOXEL * grid.pitch_mm)
    rms_voxel, z_sd = _errors(shot.droplets, scene.points_mm, found, grid.pitch_mm)
    return DropletRow(
        case=case.name,
        seed=seed,
        droplets=len(scene.heights),
        found=float(np.mean(missed >= 0)),
        ghosts=float(np.mean(found < 0)) if len(found) else 0.0,
        rms_voxel=rms_voxel,
        z_sd=z_sd,
        residual_over_noise=shot.residual_over_noise or 0.0,
        verdict=shot.verdict.value,
        twin_ghosts=shot.twins.share if shot.twins else None,
        cpu_ms_per_droplet=1000 * cpu_s / len(scene.heights),
        least_found=case.least_found,
        most_ghosts=case.most_ghosts,
    )


def _errors(droplets: Droplets, truth_mm: FloatArray, match: FloatArray, pitch_mm: float) -> tuple[float, float]:
    """Root mean square error in voxels and robust standard deviation of z-scores."""
    if np.count_nonzero(match >= 0) < 2:
        return float("nan"), float("nan")
    errors_mm, scores = place_errors(droplets, truth_mm, match)
    return float(np.sqrt(np.mean(errors_mm**2))) / pitch_mm, robust_sd(scores)


def place_errors(
    droplets: Droplets | SizedDroplets, truth_mm: FloatArray, match: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Errors of real droplets (N, 3), without what all have in common, and over what their covariance says."""
    real = match >= 0
    errors_mm = droplets.points_mm[real] - truth_mm[match[real]]
    errors_mm = errors_mm - np.median(errors_mm, axis=0)
    return errors_mm, errors_mm / np.sqrt(np.einsum("nii->ni", droplets.covariance_mm2[real]))


def robust_sd(errors: FloatArray) -> float:
    """Standard deviation about zero of errors that are normal, whatever a few wild ones do."""
    return float(np.median(np.abs(errors))) / 0.6745


def droplet_line(row: DropletRow) -> str:
    """A shot, for people."""
    shares = f"{100 * row.found:.2f} % found, {100 * row.ghosts:.2f} % ghosts"
    return f"{row.case}, seed {row.seed}: {shares}, rms {row.rms_voxel:.3f} voxel, {row.cpu_ms_per_droplet:.2f} ms each"


def all_reached(rows: Sequence[DropletRow]) -> bool | None:
    """Whether the means of all cases keep what is asked for; None where nothing is."""
    judged = [_reached(chosen) for chosen in grouped(rows, _case).values() if chosen[0].least_found is not None]
    return all(judged) if judged else None


def _reached(rows: Sequence[DropletRow]) -> bool:
    least, most = rows[0].least_found, rows[0].most_ghosts
    found, ghosts = np.mean([row.found for row in rows]), np.mean([row.ghosts for row in rows])
    return bool((least is None or found >= least) and (most is None or ghosts <= most))


def _case(row: DropletRow) -> str:
    return row.case


def droplet_statements(rows: Sequence[DropletRow]) -> list[Statement]:
    """Mean and worst shot of every case."""
    return [
        Statement(
            f"{case}: found/ghosts in %, mean and worst",
            shares_asked(chosen[0].least_found, chosen[0].most_ghosts),
            _reached_text(chosen),
        )
        for case, chosen in grouped(rows, _case).items()
    ]


def _reached_text(rows: Sequence[DropletRow]) -> str:
    rms_voxel, cpu_ms = (np.mean([getattr(row, name) for row in rows]) for name in ("rms_voxel", "cpu_ms_per_droplet"))
    return f"{shares_told(rows)}; rms {rms_voxel:.3f} voxel, {cpu_ms:.2f} CPU-ms per droplet"


def droplet_figure(rows: Sequence[DropletRow]) -> Figure:
    """Found droplets and ghosts of every case."""
    return droplets_figure(
        {
            case: MeasuredCase(
                [row.found for row in chosen],
                [row.ghosts for row in chosen],
                chosen[0].least_found,
                chosen[0].most_ghosts,
            )
            for case, chosen in grouped(rows, _case).items()
        }
    )
