"""Reconstruction quality against droplet density (Fig. 7 of the paper).

A volume is filled with Gaussian blobs, projected onto the images of four pinhole cameras, reconstructed, and
compared with the truth.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from processing.analysis.quality import quality_factor
from processing.figures.method_figures import quality_figure
from processing.reconstruction.planning.plan import plan_reconstruction
from processing.studies.recipe import ALL_RECIPES, Recipe, method_curves, reconstruct_each
from processing.studies.report import Statement
from processing.studies.simulated_droplets import (
    IMAGE_SIZE_PX,
    PAPER_COUNTS,
    PAPER_SHAPE,
    simulate_shot,
    study_cameras,
    study_grid,
)
from processing.volume import VoxelGrid

PAPER_QUALITY, PAPER_DENSITY_PER_MM3 = 0.5, 20.0
ALL_SIGMAS_VOXEL = (0.75, 1.27, 1.5, 2.0)
"""Readings of "3 voxel diameter": 4 sigma, full width at half maximum, 2 sigma; and a wider droplet."""


@dataclass(frozen=True)
class DensityStudy:
    """What to simulate; volume, densities and windows are the paper's, methods are those and how SMART gets there.

    Parameters
    ----------
    shape : tuple[int, int, int]
        Voxels (nz, ny, nx) at 60 voxel/mm.
    counts : tuple of int
        Numbers of droplets.
    sigmas_voxel : tuple of float
        Widths of the droplets. The paper says "3 voxel diameter", which leaves it open; 1.5 reproduces its figure.
    recipes : tuple of Recipe
        Methods; put fewer iterations of a method before more of them.
    window, step : int
        Interrogation windows of the quality factor, in voxels.
    image_size_px : tuple[int, int]
        (width, height) of every view.
    """

    shape: tuple[int, int, int] = PAPER_SHAPE
    counts: tuple[int, ...] = PAPER_COUNTS
    sigmas_voxel: tuple[float, ...] = (1.5,)
    recipes: tuple[Recipe, ...] = ALL_RECIPES
    window: int = 64
    step: int = 32
    image_size_px: tuple[int, int] = IMAGE_SIZE_PX

    @property
    def grid(self) -> VoxelGrid:
        """The simulated volume, centred on the world origin."""
        return study_grid(self.shape)


@dataclass(frozen=True)
class DensityRow:
    """One point of Fig. 7: mean-subtracted quality factor of a method at a droplet density."""

    density_per_mm3: float
    method: str
    quality_factor: float
    sigma_voxel: float


def density_study(study: DensityStudy | None = None) -> Iterator[DensityRow]:
    """Simulate, reconstruct and compare; yields each result as soon as it is known.

    The same study gives the same rows: droplets are placed by a generator seeded with their number.
    """
    study = study or DensityStudy()
    cameras = study_cameras(study.image_size_px)
    plan = plan_reconstruction(cameras, study.grid)
    volume = np.empty(study.shape, dtype=np.float32)
    for sigma_voxel in study.sigmas_voxel:
        for count in study.counts:
            shot = simulate_shot(study.grid, count, sigma_voxel, cameras)
            for recipe in reconstruct_each(plan, shot.images, study.recipes, volume):
                quality = quality_factor(shot.truth, volume, study.window, study.step)
                yield DensityRow(count / study.grid.volume_mm3, recipe.name, quality, sigma_voxel)


def quality_curve(rows: Sequence[DensityRow], method: str, sigma_voxel: float) -> tuple[list[float], list[float]]:
    """Densities in 1/mm^3 and quality factors of a method, in order of density."""
    chosen = [row for row in rows if row.method == method and row.sigma_voxel == sigma_voxel]
    chosen.sort(key=lambda row: row.density_per_mm3)
    return [row.density_per_mm3 for row in chosen], [row.quality_factor for row in chosen]


def limiting_density_per_mm3(
    rows: Sequence[DensityRow], method: str, sigma_voxel: float, quality: float = PAPER_QUALITY
) -> float | None:
    """Density at which the quality of a method falls below a limit, interpolated over its logarithm.

    None where it does not cross the limit within the simulated densities.
    """
    densities, qualities = quality_curve(rows, method, sigma_voxel)
    falling = zip(zip(densities, qualities, strict=True), zip(densities[1:], qualities[1:], strict=True), strict=False)
    for (thin, above), (dense, below) in falling:
        if above >= quality > below:
            return float(thin * (dense / thin) ** ((above - quality) / (above - below)))
    return None


def density_statements(rows: Sequence[DensityRow]) -> list[Statement]:
    """Up to which density MLOS works, and which line-of-sight method is best: the paper's words and ours."""
    statements = []
    for sigma_voxel in dict.fromkeys(row.sigma_voxel for row in rows):
        limit = limiting_density_per_mm3(rows, "mlos", sigma_voxel)
        found = "not crossed by these densities" if limit is None else f"{limit:.0f} droplets/mm3"
        topic = f"sigma {sigma_voxel:g} voxel, density at which MLOS falls below Q = {PAPER_QUALITY}"
        statements.append(Statement(topic, f"about {PAPER_DENSITY_PER_MM3:.0f} droplets/mm3", found))
        best = _best_lines_of_sight(rows, sigma_voxel)
        topic = f"sigma {sigma_voxel:g} voxel, best line-of-sight method above 7 droplets/mm3"
        statements.append(Statement(topic, "MLOS", ", ".join(best) or "not simulated"))
    return statements


def _best_lines_of_sight(rows: Sequence[DensityRow], sigma_voxel: float) -> list[str]:
    """The best of MLOS, MINLOS and GAVLOS at every density above the paper's limit of 7 per mm^3."""
    best: dict[float, DensityRow] = {}
    for row in rows:
        counts = row.sigma_voxel == sigma_voxel and row.method.endswith("los") and row.density_per_mm3 > 7
        if counts and (
            row.density_per_mm3 not in best or row.quality_factor > best[row.density_per_mm3].quality_factor
        ):
            best[row.density_per_mm3] = row
    return [f"{row.method.upper()} at {density:.0f}" for density, row in sorted(best.items())]


def density_figure(rows: Sequence[DensityRow], study: DensityStudy | None = None) -> Figure:
    """Quality factor against droplet density, one curve per method and one panel per sigma (Fig. 7, right)."""
    study = study or DensityStudy()
    panels = {
        sigma_voxel: method_curves(
            [row for row in rows if row.sigma_voxel == sigma_voxel], "density_per_mm3", "quality_factor"
        )
        for sigma_voxel in dict.fromkeys(row.sigma_voxel for row in rows)
    }
    return quality_figure(panels, (PAPER_DENSITY_PER_MM3, PAPER_QUALITY), study.window, study.step)
