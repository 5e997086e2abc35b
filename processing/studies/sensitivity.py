"""What a lab asks before it buys a camera: how calibration error, number and spread of views, and noise matter.

Found droplets and ghosts in a slice of the paper's simulated volume: full width and depth, so that lines of sight
are as long as the paper's, but less high; no view looks along y.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from matplotlib.figure import Figure

from processing.figures.method_figures import influences_figure
from processing.geometry import PinholeCamera, view_camera
from processing.reconstruction.planning.plan import plan_reconstruction
from processing.studies.detection import RADIUS_VOXEL, detection_curve, half_median_threshold
from processing.studies.recipe import Recipe, method_curves, reconstruct_each
from processing.studies.report import Statement
from processing.studies.simulated_droplets import (
    SCALE_VOXEL_PER_MM,
    Image,
    blob_volume,
    droplet_centres,
    normalised,
    project_volume,
    study_cameras,
    study_grid,
)
from processing.synthetic.paper_rig import TABLE_1
from processing.volume import VoxelGrid

FOCAL_LENGTH_MM, MAGNIFICATION = 92.5, 0.44
"""Mean lens of Table 1, the same for every view."""
NOISE_FLOOR_SIGMAS = 2.0
"""Intensity that preprocessing cuts off, in standard deviations of the noise."""


class Influence(StrEnum):
    """What a lab varies."""

    CALIBRATION_ERROR = "calibration_error_px"
    """Distance by which every view is misaligned, each in a direction of its own."""
    VIEWS = "views"
    """Number of views, spread evenly over the range of yaw."""
    YAW_SPREAD = "yaw_spread_deg"
    """Angle between the outermost views."""
    NOISE = "noise_percent"
    """Standard deviation of the images' noise, relative to the contrast of a single droplet."""


LABELS = {
    Influence.CALIBRATION_ERROR: "calibration error of every view [px]",
    Influence.VIEWS: "number of views",
    Influence.YAW_SPREAD: "angle between the outermost views [°]",
    Influence.NOISE: "image noise [% of a droplet's contrast]",
}


@dataclass(frozen=True)
class Setup:
    """A rig and its images; the defaults are the paper's rig without errors.

    Parameters
    ----------
    calibration_error_px, views, yaw_spread_deg, noise_percent : float, int, float, float
        See ``Influence``.
    """

    calibration_error_px: float = 0.0
    views: int = 4
    yaw_spread_deg: float = 90.0
    noise_percent: float = 0.0


@dataclass(frozen=True)
class SensitivityStudy:
    """What to vary, one influence at a time around the paper's rig.

    Parameters
    ----------
    shape : tuple[int, int, int]
        Voxels (nz, ny, nx) at 60 voxel/mm.
    density_per_mm3 : float
        Droplet density.
    sigma_voxel : float
        Width of the droplets.
    recipes : tuple of Recipe
        Methods.
    calibration_errors_px, views, yaw_spreads_deg, noises_percent : tuple
        Values of each influence.
    repeats : int
        Realisations of droplets, misalignment and noise that every point averages.
    image_size_px : tuple[int, int]
        (width, height) of every view.
    """

    shape: tuple[int, int, int] = (250, 100, 500)
    density_per_mm3: float = 13.8
    sigma_voxel: float = 1.0
    recipes: tuple[Recipe, ...] = (Recipe.named("mlos"), Recipe.named("smart-10"))
    calibration_errors_px: tuple[float, ...] = (0.0, 0.1, 0.3, 0.5, 0.75, 1.0, 1.5, 2.0)
    views: tuple[int, ...] = (2, 3, 4, 5, 6)
    yaw_spreads_deg: tuple[float, ...] = (15.0, 30.0, 60.0, 90.0, 120.0)
    noises_percent: tuple[float, ...] = (0.0, 2.0, 5.0, 10.0, 20.0, 40.0)
    repeats: int = 3
    image_size_px: tuple[int, int] = (640, 160)

    @property
    def grid(self) -> VoxelGrid:
        """The simulated volume, centred on the world origin."""
        return study_grid(self.shape)

    @property
    def setups(self) -> list[tuple[Influence, float, Setup]]:
        """Influence, its value and the rig, for every point."""
        return [
            *((Influence.CALIBRATION_ERROR, px, Setup(calibration_error_px=px)) for px in self.calibration_errors_px),
            *((Influence.VIEWS, float(number), Setup(views=number)) for number in self.views),
            *((Influence.YAW_SPREAD, deg, Setup(yaw_spread_deg=deg)) for deg in self.yaw_spreads_deg),
            *((Influence.NOISE, percent, Setup(noise_percent=percent)) for percent in self.noises_percent),
        ]


@dataclass(frozen=True)
class SensitivityRow:
    """Found droplets (share of the true ones) and ghosts (share of the peaks) at one value of an influence."""

    influence: str
    value: float
    method: str
    found: float
    ghosts: float
    density_per_mm3: float
    sigma_voxel: float


def sensitivity_study(study: SensitivityStudy | None = None) -> Iterator[SensitivityRow]:
    """Simulate every rig and count droplets and ghosts; thresholds need no truth. The same study, the same rows."""
    study = study or SensitivityStudy()
    volume = np.empty(study.shape, dtype=np.float32)
    for influence, value, setup in study.setups:
        repeated = [list(_rates(study, setup, seed, volume)) for seed in range(study.repeats)]
        for number, recipe in enumerate(study.recipes):
            found, ghosts = np.mean([rates[number] for rates in repeated], axis=0)
            yield SensitivityRow(
                influence.value,
                value,
                recipe.name,
                float(found),
                float(ghosts),
                study.density_per_mm3,
                study.sigma_voxel,
            )


def _rates(study: SensitivityStudy, setup: Setup, seed: int, volume: Image) -> Iterator[tuple[float, float]]:
    """Found and ghosts of every recipe in one realisation."""
    rng = np.random.default_rng(seed)
    grid, cameras = study.grid, setup_cameras(setup, study.image_size_px)
    centres_voxel = droplet_centres(study.shape, round(study.density_per_mm3 * grid.volume_mm3), rng)
    truth = blob_volume(study.shape, centres_voxel, study.sigma_voxel)
    images = [project_volume(truth, grid, camera) for camera in cameras]
    noisy = normalised([noisy_image(image, setup, study.sigma_voxel, rng) for image in images])
    believed = [misaligned(camera, setup.calibration_error_px, rng) for camera in cameras]
    for _ in reconstruct_each(plan_reconstruction(believed, grid), noisy, study.recipes, volume):
        curve = detection_curve(centres_voxel, volume, RADIUS_VOXEL)
        rates = curve.rates(half_median_threshold(curve))
        yield rates.found, rates.ghosts


def spread_cameras(views: int, image_size_px: tuple[int, int]) -> list[PinholeCamera]:
    """The paper's four views, or another number spread over the same angles."""
    return study_cameras(image_size_px) if views == len(TABLE_1) else setup_cameras(Setup(views=views), image_size_px)


def setup_cameras(setup: Setup, image_size_px: tuple[int, int]) -> list[PinholeCamera]:
    """Views spread evenly over the range of yaw, all with the mean lens of Table 1."""
    yaws_deg = np.linspace(-0.5, 0.5, setup.views) * setup.yaw_spread_deg
    return [
        view_camera(
            float(yaw_deg),
            focal_length_mm=FOCAL_LENGTH_MM,
            magnification=MAGNIFICATION,
            scale_px_per_mm=SCALE_VOXEL_PER_MM,
            image_size_px=image_size_px,
        )
        for yaw_deg in yaws_deg
    ]


def misaligned(camera: PinholeCamera, error_px: float, rng: np.random.Generator) -> PinholeCamera:
    """What a calibration believes that is wrong by a shift of the image in a random direction."""
    angle_rad = rng.uniform(0, 2 * np.pi)
    matrix = camera.camera_matrix.copy()
    matrix[:2, 2] += error_px * np.array([np.cos(angle_rad), np.sin(angle_rad)])
    return replace(camera, camera_matrix=matrix)


def noisy_image(image: Image, setup: Setup, sigma_voxel: float, rng: np.random.Generator) -> Image:
    """An image with Gaussian noise, and what preprocessing makes of it: the noise floor is cut off."""
    if setup.noise_percent == 0:
        return image
    contrast = np.sqrt(2 * np.pi) * sigma_voxel  # line of sight through the middle of a Gaussian of height 1
    sigma = setup.noise_percent / 100 * contrast
    noise = rng.normal(0, sigma, image.shape).astype(np.float32)
    cleaned: Image = np.maximum(image + noise - np.float32(NOISE_FLOOR_SIGMAS * sigma), np.float32(0))
    return cleaned


def sensitivity_statements(rows: Sequence[SensitivityRow]) -> list[Statement]:
    """What each influence does to the last method, beside the paper's rig."""
    papers = {
        Influence.CALIBRATION_ERROR: "calibrated to < 0.05 px; effect not studied",
        Influence.VIEWS: "4 views; effect not studied",
        Influence.YAW_SPREAD: "90 degrees; effect not studied",
        Influence.NOISE: "not studied",
    }
    method = rows[-1].method
    return [
        Statement(f"{influence.value}, {Recipe.named(method).label}, found/ghosts in %", paper, ", ".join(found))
        for influence, paper in papers.items()
        if (found := [_value_text(row) for row in rows if (row.influence, row.method) == (influence.value, method)])
    ]


def _value_text(row: SensitivityRow) -> str:
    return f"{row.value:g}: {100 * row.found:.1f}/{100 * row.ghosts:.1f}"


def sensitivity_figure(rows: Sequence[SensitivityRow]) -> Figure:
    """Found droplets and ghosts against each influence, one panel each."""
    panels = {}
    for influence in (one for one in Influence if any(row.influence == one for row in rows)):
        chosen = [row for row in rows if row.influence == influence]
        found, ghosts = (method_curves(chosen, "value", quantity) for quantity in ("found", "ghosts"))
        panels[LABELS[influence]] = (found, ghosts)
    title = (
        rf"{rows[0].density_per_mm3:g} droplets/mm³ of $\sigma$ = {rows[0].sigma_voxel:g} voxel; "
        "found: share of the droplets, ghosts: share of the peaks"
    )
    return influences_figure(panels, {LABELS[Influence.VIEWS], LABELS[Influence.YAW_SPREAD]}, title)
