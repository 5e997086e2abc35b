"""Mean of many shots of the hollow cone in a slice across its axis (Fig. 6 of the paper)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from processing.figures.average_figures import Slice, mean_slices_figure
from processing.reconstruction.mean_line_of_sight import mean_line_of_sight
from processing.reconstruction.planning.plan import plan_reconstruction
from processing.studies.hollow_cone_shots import cropped_cameras, height_mm, hollow_cone_images, slab_grid
from processing.studies.recipe import Recipe, reconstruct_each
from processing.studies.report import Statement
from processing.studies.ring import RadialProfile, radial_profile
from processing.volume import VoxelGrid

_BATCH = 8
"""Shots whose images are in memory at the same time."""


@dataclass(frozen=True)
class AverageStudy:
    """What to average; shots, methods and height are the paper's.

    Parameters
    ----------
    shots : int
        Realisations of the spray.
    recipes : tuple of Recipe
        Methods, in the order of the figure.
    diameters_from_orifice : float
        Height of the slice, in orifice diameters d0.
    binning : int
        Pixels binned in either direction, and voxels with them; 1 is the paper's resolution.
    radius_mm : float
        Half the edge of the reconstructed square. All liquid at the height of the slice must lie inside.
    rows : int
        Height of the reconstructed slab in voxels. SMART needs more than the slice: lines of sight are tilted.
    seed : int
        Of spray, dust and noise.
    """

    shots: int = 266
    recipes: tuple[Recipe, ...] = tuple(Recipe.named(name) for name in ("gavlos", "minlos", "mlos", "smart"))
    diameters_from_orifice: float = 25.0
    binning: int = 2
    radius_mm: float = 4.5
    rows: int = 15
    seed: int = 0

    @property
    def grid(self) -> VoxelGrid:
        """The reconstructed slab."""
        return slab_grid(height_mm(self.diameters_from_orifice), self.radius_mm, self.rows, self.binning)


@dataclass(frozen=True, eq=False)
class MeanSlices:
    """Averages of a study.

    Parameters
    ----------
    study : AverageStudy
        What was averaged.
    slices : Mapping[str, (nz, nx) array]
        Mean intensity by name of the recipe.
    """

    study: AverageStudy
    slices: Mapping[str, Slice]

    def profile(self, method: str) -> RadialProfile:
        """Radial profile of a method in bins of one voxel."""
        grid = self.study.grid
        return radial_profile(self.slices[method], grid.x_mm, grid.z_mm, grid.pitch_mm)


@dataclass(frozen=True)
class AverageRow:
    """The ring of a method: radius, width at half maximum, height, steepest flanks, and what is left in its middle.

    Height and gradients are relative to the mean intensity of the slice, the middle to the height.
    """

    method: str
    shots: int
    ring_mm: float
    width_mm: float
    height: float
    inner_gradient_per_mm: float
    outer_gradient_per_mm: float
    centre: float


@dataclass(frozen=True)
class ProfileRow:
    """One point of a radial profile."""

    method: str
    radius_mm: float
    intensity: float
    gradient_per_mm: float


def average_study(
    study: AverageStudy | None = None,
    done: Callable[[int], None] = lambda _: None,
) -> MeanSlices:
    """Reconstruct every shot by every method and average the slice in the middle of the slab.

    Parameters
    ----------
    study : AverageStudy, optional
        The paper's by default.
    done : callable
        Told the number of shots after each.
    """
    study = study or AverageStudy()
    grid = study.grid
    cameras = cropped_cameras(grid, study.binning)
    plan = plan_reconstruction(list(cameras.values()), grid)
    volume = np.empty(grid.shape, dtype=np.float32)
    sums = {recipe.name: np.zeros((grid.shape[0], grid.shape[2])) for recipe in study.recipes}
    iterating = [recipe for recipe in study.recipes if recipe.method.iterative]
    shots = enumerate(hollow_cone_images(cameras, study.shots, study.binning, study.seed), 1)
    while batch := list(islice(shots, _BATCH)):
        exposures = [images for _, images in batch]
        for recipe in (recipe for recipe in study.recipes if not recipe.method.iterative):
            mean = mean_line_of_sight(plan, exposures, recipe.method, volume)
            sums[recipe.name] += len(batch) * mean[:, study.rows // 2]
        for number, images in batch:
            for recipe in reconstruct_each(plan, images, iterating, volume):
                sums[recipe.name] += volume[:, study.rows // 2]
            done(number)
    return MeanSlices(study, {name: total / study.shots for name, total in sums.items()})


def average_rows(mean: MeanSlices) -> list[AverageRow]:
    """The ring of every method."""
    rows = []
    for method in mean.slices:
        profile = mean.profile(method)
        rows.append(
            AverageRow(
                method=method,
                shots=mean.study.shots,
                ring_mm=profile.ring_mm,
                width_mm=profile.width_mm,
                height=float(profile.intensities.max()),
                inner_gradient_per_mm=profile.inner_gradient_per_mm,
                outer_gradient_per_mm=profile.outer_gradient_per_mm,
                centre=float(
                    profile.intensities[profile.radii_mm < 0.5 * profile.ring_mm].mean() / profile.intensities.max()
                ),
            )
        )
    return rows


def profile_rows(mean: MeanSlices) -> list[ProfileRow]:
    """The radial profiles of all methods."""
    return [
        ProfileRow(method, float(radius), float(value), float(gradient))
        for method in mean.slices
        for radius, value, gradient in _points(mean.profile(method))
    ]


def _points(profile: RadialProfile) -> NDArray[np.float64]:
    return np.column_stack([profile.radii_mm, profile.intensities, profile.gradients_per_mm])


def average_statements(rows: Sequence[AverageRow]) -> list[Statement]:
    """Whose flanks are steepest: the paper's order and ours."""
    statements = []
    for side in ("inner", "outer"):
        steepest = sorted(rows, key=lambda row: -getattr(row, f"{side}_gradient_per_mm"))
        found = ", ".join(
            f"{Recipe.named(row.method).label} {getattr(row, f'{side}_gradient_per_mm'):.2f}/mm" for row in steepest
        )
        topic = f"steepest {side} flank of the ring"
        statements.append(Statement(topic, "SMART-20, then MLOS, then MINLOS and GAVLOS", found))
    return statements


def average_figure(mean: MeanSlices) -> Figure:
    """Mean slices in the order of Fig. 6, and their radial profiles."""
    study, recipes = mean.study, {method: Recipe.named(method) for method in mean.slices}
    profiles = {method: mean.profile(method) for method in mean.slices}
    return mean_slices_figure(
        {recipe.label: mean.slices[method] for method, recipe in recipes.items()},
        study.grid,
        [recipes[method].curve(one.radii_mm, one.intensities) for method, one in profiles.items()],
        [recipes[method].curve(one.radii_mm, one.gradients_per_mm) for method, one in profiles.items()],
        f"mean of {study.shots} synthetic shots of the hollow cone, "
        rf"y = {study.diameters_from_orifice:g} $d_0$, voxel {1000 * study.grid.pitch_mm:.1f} µm",
    )
