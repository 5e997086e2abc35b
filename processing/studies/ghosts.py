"""Found and ghost droplets against droplet density: the question that the paper leaves open.

The same simulation as for Fig. 7; every peak of the reconstruction above a threshold counts as a droplet.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from matplotlib.figure import Figure

from processing.figures.method_figures import ghosts_figure
from processing.reconstruction.planning.plan import plan_reconstruction
from processing.studies.detection import (
    RADIUS_VOXEL,
    DetectionCurve,
    best_threshold,
    detection_curve,
    half_median_threshold,
)
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

MIN_FOUND, MAX_GHOSTS = 0.97, 0.02
"""What droplet tracking can live with."""
TARGET_SIGMA_VOXEL, TARGET_DENSITY_PER_MM3 = 1.0, 28.0
"""Droplets of this width, up to this density: SMART-20 is to find so many with so few ghosts."""


class ThresholdRule(StrEnum):
    """How high a peak must be to count as a droplet."""

    HALF_MEDIAN = "half_median"
    """Half the median height of the peaks that count. Needs no truth."""
    BEST_WITH_TRUTH = "best_with_truth"
    """Least missed droplets plus ghosts. Uses the truth: a bound for any rule."""


_THRESHOLDS: dict[ThresholdRule, Callable[[DetectionCurve], float]] = {
    ThresholdRule.HALF_MEDIAN: half_median_threshold,
    ThresholdRule.BEST_WITH_TRUTH: best_threshold,
}


@dataclass(frozen=True)
class GhostStudy:
    """What to simulate; volume and densities are the paper's.

    Parameters
    ----------
    shape : tuple[int, int, int]
        Voxels (nz, ny, nx) at 60 voxel/mm.
    counts : tuple of int
        Numbers of droplets.
    sigma_voxel : float
        Width of the droplets.
    recipes : tuple of Recipe
        Methods; put fewer iterations of a method before more of them.
    radius_voxel : float
        How far a peak may lie from its droplet.
    image_size_px : tuple[int, int]
        (width, height) of every view.
    """

    shape: tuple[int, int, int] = PAPER_SHAPE
    counts: tuple[int, ...] = PAPER_COUNTS
    sigma_voxel: float = 1.0
    recipes: tuple[Recipe, ...] = ALL_RECIPES
    radius_voxel: float = RADIUS_VOXEL
    image_size_px: tuple[int, int] = IMAGE_SIZE_PX


@dataclass(frozen=True)
class GhostRow:
    """Found droplets (share of the true ones) and ghosts (share of the peaks) of a method at a density."""

    density_per_mm3: float
    method: str
    threshold_rule: str
    threshold: float
    found: float
    ghosts: float
    sigma_voxel: float


def ghost_study(study: GhostStudy | None = None) -> Iterator[GhostRow]:
    """Simulate, reconstruct and count; yields each result as soon as it is known. The same study, the same rows."""
    study = study or GhostStudy()
    grid, cameras = study_grid(study.shape), study_cameras(study.image_size_px)
    plan = plan_reconstruction(cameras, grid)
    volume = np.empty(study.shape, dtype=np.float32)
    for count in study.counts:
        shot = simulate_shot(grid, count, study.sigma_voxel, cameras)
        for recipe in reconstruct_each(plan, shot.images, study.recipes, volume):
            curve = detection_curve(shot.centres_voxel, volume, study.radius_voxel)
            for rule, choose in _THRESHOLDS.items():
                threshold = choose(curve)
                rates = curve.rates(threshold)
                density = count / grid.volume_mm3
                yield GhostRow(
                    density, recipe.name, rule.value, threshold, rates.found, rates.ghosts, study.sigma_voxel
                )


def ghost_statements(rows: Sequence[GhostRow]) -> list[Statement]:
    """Up to which density each method can be trusted, with and without truth in the choice of the threshold."""
    topic = f"densities with >= {100 * MIN_FOUND:.0f} % found and <= {100 * MAX_GHOSTS:.0f} % ghosts"
    return [
        Statement(f"{Recipe.named(method).label}, {rule.value}: {topic}", "left open", _trusted(rows, method, rule))
        for method in dict.fromkeys(row.method for row in rows)
        for rule in ThresholdRule
    ]


def meets_target(rows: Sequence[GhostRow]) -> bool | None:
    """Whether SMART-20 keeps both limits up to the target's density, without truth in the choice of the threshold.

    None where SMART-20, the width of the droplets, or a density of at least half the target's is not among the rows.
    """
    judged = [
        row
        for row in _curve(rows, "smart", ThresholdRule.HALF_MEDIAN)
        if row.density_per_mm3 <= TARGET_DENSITY_PER_MM3 and row.sigma_voxel == TARGET_SIGMA_VOXEL
    ]
    if not judged or judged[-1].density_per_mm3 < 0.5 * TARGET_DENSITY_PER_MM3:
        return None
    return all(row.found >= MIN_FOUND and row.ghosts <= MAX_GHOSTS for row in judged)


def _trusted(rows: Sequence[GhostRow], method: str, rule: ThresholdRule) -> str:
    trusted = None
    for row in _curve(rows, method, rule):
        if row.found < MIN_FOUND or row.ghosts > MAX_GHOSTS:
            break
        trusted = row
    if trusted is None:
        return "none of the simulated ones"
    return (
        f"up to {trusted.density_per_mm3:.1f} droplets/mm3 "
        f"({100 * trusted.found:.1f} % found, {100 * trusted.ghosts:.1f} % ghosts)"
    )


def _curve(rows: Sequence[GhostRow], method: str, rule: ThresholdRule) -> list[GhostRow]:
    chosen = [row for row in rows if row.method == method and row.threshold_rule == rule]
    return sorted(chosen, key=lambda row: row.density_per_mm3)


def ghost_figure(rows: Sequence[GhostRow]) -> Figure:
    """Found droplets and ghosts against density; one line of panels per choice of the threshold."""
    titles = {
        ThresholdRule.HALF_MEDIAN: "threshold: half the median of the peaks above it",
        ThresholdRule.BEST_WITH_TRUTH: "best threshold, chosen with the truth",
    }
    panels = {}
    for rule, title in titles.items():
        chosen = [row for row in rows if row.threshold_rule == rule]
        found, ghosts = (method_curves(chosen, "density_per_mm3", quantity) for quantity in ("found", "ghosts"))
        panels[title] = (found, ghosts)
    return ghosts_figure(panels, (MIN_FOUND, MAX_GHOSTS), rows[0].sigma_voxel)
