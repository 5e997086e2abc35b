"""Droplets found, ghosts and sizes of opaque droplets in shadow images: the measuring of sizes against known truth.

The truth has no part in it: droplets unite before they are blurred, out of focus by their depth, before light that is
counted; noise, level, blur and shift of every view are estimated from the images.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import cycle, islice

import numpy as np
from matplotlib.figure import Figure

from processing.analysis.droplets.droplet_search import MARGIN_VOXEL, plan_droplets
from processing.analysis.droplets.ghost_share import RADIUS_VOXEL, matches
from processing.analysis.droplets.shadows.shadow_shot import measure_shadows
from processing.figures.droplet_figures import MeasuredCase, droplets_figure
from processing.geometry import PinholeCamera
from processing.kernels import DEFAULT_THREADS
from processing.studies.droplets import IMAGE_SIZE_PX, SLAB
from processing.studies.report import Statement, all_kept, by_case, case_statements, shares_asked, shares_told
from processing.studies.sensitivity import misaligned, spread_cameras
from processing.studies.shadows.size_errors import d32_of, size_errors
from processing.studies.simulated_droplets import Image, study_grid
from processing.synthetic.liquid.droplet_clouds import Box, LogNormal, droplet_cloud
from processing.synthetic.paper_rig import TABLE_1, paper_optics
from processing.synthetic.shadow_shots import Counting, transmission_images
from processing.synthetic.spray import Spray
from processing.volume import VoxelGrid

COUNTED_UM = 20.0
"""Found droplets and ghosts are counted from this diameter on."""
BESIDE_MM = 0.15
"""So far around the grid there are droplets, too."""


@dataclass(frozen=True)
class SizeCase:
    """What to simulate, and what is asked for.

    Parameters
    ----------
    density_per_mm3 : float
        Of the droplets.
    median_um, spread : float
        Of their lognormal diameters, none below 10 um.
    noise_percent : float
        Of the background.
    views : int
        The paper's four, or another number spread over the same angles, with lenses like the paper's in turn.
    calibration_error_px : float
        By which each view lies beside its calibration, in a direction of its own.
    condenser_ratio : float | None
        Numerical aperture of the light over that of the lens; None: blur is Gaussian.
    aperture_ratio : float
        Numerical aperture of the lenses over those of the paper: less blurs more.
    least_found, most_ghosts : float | None
        Shares of the droplets from 20 um on that the mean of the shots must keep.
    most_d32_error, most_sd_um : float | None
        Relative error of D32 of any shot, and robust standard deviation of diameters of 20 to 60 um.
    """

    density_per_mm3: float = 14.0
    median_um: float = 40.0
    spread: float = 0.4
    noise_percent: float = 1.2
    views: int = len(TABLE_1)
    calibration_error_px: float = 0.0
    condenser_ratio: float | None = None
    aperture_ratio: float = 1.0
    least_found: float | None = None
    most_ghosts: float | None = None
    most_d32_error: float | None = None
    most_sd_um: float | None = None

    @property
    def name(self) -> str:
        """For tables and figures."""
        parts = [f"{self.density_per_mm3:g}/mm³", f"{self.median_um:g} um", f"noise {self.noise_percent:g} %"]
        if self.views != len(TABLE_1):
            parts.append(f"{self.views} views")
        if self.calibration_error_px:
            parts.append(f"calibration {self.calibration_error_px:g} px off")
        if self.condenser_ratio:
            parts.append(f"condenser ratio {self.condenser_ratio:g}")
        if self.aperture_ratio != 1:
            parts.append(f"aperture x {self.aperture_ratio:g}")
        return ", ".join(parts)

    @property
    def sizes(self) -> LogNormal:
        """Of the droplets."""
        return LogNormal(self.median_um / 1000, self.spread)


ASKED_FOR = (
    SizeCase(7, least_found=0.98, most_ghosts=0.007, most_d32_error=0.02),
    SizeCase(14, least_found=0.98, most_ghosts=0.01, most_d32_error=0.02, most_sd_um=0.6),
    SizeCase(28, least_found=0.965, most_ghosts=0.04, most_d32_error=0.02),
)


@dataclass(frozen=True)
class SizeStudy:
    """Which cases, and how often.

    Parameters
    ----------
    cases : tuple of SizeCase
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

    cases: tuple[SizeCase, ...] = ASKED_FOR
    seeds: tuple[int, ...] = (301, 302, 303, 304, 305)
    shape: tuple[int, int, int] = SLAB
    image_size_px: tuple[int, int] = IMAGE_SIZE_PX
    margin_voxel: int = MARGIN_VOXEL
    twins: int = 0


@dataclass(frozen=True)
class SizeRow:
    """One shot: found (share of the droplets from 20 um on), ghosts (share of what was found), and how exact.

    ``bias_um`` and ``sd_um`` are median and robust standard deviation of errors of diameters from 20 to 60 um,
    ``d32_error`` is relative, of all diameters; ``z_sd`` and ``z_size`` the robust standard deviations of errors of
    places and diameters over what their covariance says, ``held`` and ``size_held`` the shares of the errors that 95 %
    intervals hold.
    """

    case: str
    seed: int
    droplets: int
    found: float
    ghosts: float
    rms_voxel: float
    bias_um: float
    sd_um: float
    d32_um: float
    d32_error: float
    z_sd: float
    z_size: float
    held: float
    size_held: float
    residual_over_noise: float
    verdict: str
    twin_ghosts: float | None
    cpu_ms_per_droplet: float


def size_study(study: SizeStudy | None = None, threads: int = DEFAULT_THREADS) -> Iterator[SizeRow]:
    """Simulate, measure and compare, shot by shot. The same study gives the same shares; times differ."""
    study = study or SizeStudy()
    for case in study.cases:
        for seed in study.seeds:
            yield _row(study, case, seed, threads)


@dataclass(frozen=True, eq=False)
class ShadowScene:
    """A simulated shot of shadows.

    Parameters
    ----------
    spray : Spray
        Its droplets.
    images : list of (rows, columns) float32 arrays
        Transmissions, one per camera.
    believed : list of PinholeCamera
        What the calibration takes the cameras for.
    """

    spray: Spray
    images: list[Image]
    believed: list[PinholeCamera]


def size_scene(
    case: SizeCase, grid: VoxelGrid, image_size_px: tuple[int, int], rng: np.random.Generator
) -> ShadowScene:
    """A shot of a case: droplets all over a grid and a little beyond, uniformly."""
    cameras = spread_cameras(case.views, image_size_px)
    spray = droplet_cloud(Box.around(grid, BESIDE_MM), case.density_per_mm3, case.sizes, rng)
    images = shadow_images(case, cameras, spray, rng)
    return ShadowScene(spray, images, [misaligned(camera, case.calibration_error_px, rng) for camera in cameras])


def shadow_images(
    case: SizeCase, cameras: Sequence[PinholeCamera], spray: Spray, rng: np.random.Generator
) -> list[Image]:
    """What the lenses of a case show of opaque droplets, with noise."""
    optics = [
        replace(view, f_number=view.f_number / case.aperture_ratio, condenser_ratio=case.condenser_ratio)
        for view in islice(cycle(paper_optics().values()), len(cameras))
    ]
    return list(transmission_images(cameras, optics, spray, Counting.of_noise(case.noise_percent / 100), rng))


def _row(study: SizeStudy, case: SizeCase, seed: int, threads: int) -> SizeRow:
    grid = study_grid(study.shape)
    scene = size_scene(case, grid, study.image_size_px, np.random.default_rng(seed))
    started_cpu_s = time.process_time()
    search = plan_droplets(scene.believed, grid, margin_voxel=study.margin_voxel)
    shot = measure_shadows(scene.images, search, twins=study.twins, seed=seed, threads=threads)
    cpu_s = (time.process_time() - started_cpu_s) / (1 + study.twins)
    truth = scene.spray.inside(grid)
    large, counted = truth.diameters_mm > COUNTED_UM / 1000, shot.droplets.diameters_um > COUNTED_UM
    match, _ = matches(shot.droplets.points_mm, scene.spray.positions_mm, RADIUS_VOXEL * grid.pitch_mm)
    _, missed = matches(shot.droplets.points_mm, truth.positions_mm, RADIUS_VOXEL * grid.pitch_mm)
    d32_um = d32_of(shot.droplets.diameters_um)
    return SizeRow(
        case=case.name,
        seed=seed,
        droplets=int(np.count_nonzero(large)),
        found=float(np.mean(missed[large] >= 0)),
        ghosts=float(np.mean(match[counted] < 0)) if counted.any() else 0.0,
        **size_errors(shot.droplets, scene.spray, match, grid.pitch_mm),
        d32_um=d32_um,
        d32_error=d32_um / d32_of(1000 * truth.diameters_mm) - 1,
        residual_over_noise=shot.residual_over_noise or 0.0,
        verdict=shot.verdict.value,
        twin_ghosts=shot.twins.share if shot.twins else None,
        cpu_ms_per_droplet=1000 * cpu_s / len(truth.diameters_mm),
    )


def size_line(row: SizeRow) -> str:
    """A shot, for people."""
    shares = f"{100 * row.found:.2f} % found, {100 * row.ghosts:.2f} % ghosts"
    sizes = f"D {row.bias_um:+.2f} +- {row.sd_um:.2f} um, D32 {100 * row.d32_error:+.2f} %"
    return f"{row.case}, seed {row.seed}: {shares}, {sizes}, {row.cpu_ms_per_droplet:.2f} ms each"


def all_reached(rows: Sequence[SizeRow], cases: Sequence[SizeCase]) -> bool | None:
    """Whether every case keeps what is asked for; None where nothing is."""
    return all_kept(cases, rows, _reached)


def _reached(case: SizeCase, rows: Sequence[SizeRow]) -> bool | None:
    if case.least_found is None:
        return None
    limits = [
        (case.most_ghosts, float(np.mean([row.ghosts for row in rows]))),
        (case.most_d32_error, max(abs(row.d32_error) for row in rows)),
        (case.most_sd_um, float(np.mean([row.sd_um for row in rows]))),
    ]
    enough = np.mean([row.found for row in rows]) >= case.least_found
    return bool(enough) and all(limit is None or value <= limit for limit, value in limits)


def size_statements(rows: Sequence[SizeRow], cases: Sequence[SizeCase]) -> list[Statement]:
    """Mean and worst shot of every case."""
    topic = ": found/ghosts in % from 20 um on, mean and worst"
    return case_statements(by_case(cases, rows), lambda _: topic, _asked, _told)


def _asked(case: SizeCase) -> str:
    return shares_asked(case.least_found, case.most_ghosts)


def _told(rows: Sequence[SizeRow]) -> str:
    d32 = max(abs(row.d32_error) for row in rows)
    sd_um, cpu_ms = (np.mean([getattr(row, name) for row in rows]) for name in ("sd_um", "cpu_ms_per_droplet"))
    return f"{shares_told(rows)}; D +- {sd_um:.2f} um, D32 to {100 * d32:.1f} %, {cpu_ms:.1f} CPU-ms per droplet"


def size_figure(rows: Sequence[SizeRow], cases: Sequence[SizeCase]) -> Figure:
    """Found droplets and ghosts of every case."""
    return droplets_figure(
        {
            case.name: MeasuredCase(
                [row.found for row in its], [row.ghosts for row in its], case.least_found, case.most_ghosts
            )
            for case, its in by_case(cases, rows)
        }
    )
