"""``tomoshadow study``: each study writes CSV and figure, and says what the paper says beside what it found."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from daq.counted import counted
from server.cli.options import Verbs, count, positive, seed, width
from server.cli.output import Bar, progress
from server.cli.studies.breakup import add_break_up
from server.cli.studies.droplets import add_droplets
from server.cli.studies.persistence import add_persistence
from server.cli.studies.reality import add_reality
from server.cli.studies.sizes import add_sizes
from server.cli.studies.statistics import add_statistics
from server.cli.studies.study_command import add_study, collected, report
from server.cli.studies.tracks import add_tracks
from server.cli.studies.velocity import add_velocity

if TYPE_CHECKING:
    from processing.studies.density import DensityRow
    from processing.studies.ghosts import GhostRow
    from processing.studies.recipe import Recipe
    from processing.studies.residuals import ResidualRow
    from processing.studies.sensitivity import SensitivityRow

_EVERY_METHOD = "all, SMART after 5, 10 and 20 iterations, MART after 5"


def add(verbs: Verbs) -> None:
    """Add all studies; defaults are the paper's."""
    studies = verbs.add_parser("study", help="the paper's simulations").add_subparsers(required=True, metavar="STUDY")
    _add_density(studies)
    _add_ghosts(studies)
    _add_average(studies)
    _add_residuals(studies)
    _add_calibration(studies)
    _add_sensitivity(studies)
    add_droplets(studies)
    add_sizes(studies)
    add_velocity(studies)
    add_tracks(studies)
    add_statistics(studies)
    add_break_up(studies)
    add_reality(studies)
    add_persistence(studies)


def _add_methods(parser: ArgumentParser, default: str) -> None:
    parser.add_argument(
        "--method",
        type=recipe_name,
        action="append",
        metavar="NAME[-N]",
        help=f"mlos, minlos, gavlos, smart-N or mart-N with N iterations, repeatable; default {default}",
    )


def recipe_name(text: str) -> str:
    """The name of a recipe."""
    from processing.studies.recipe import Recipe

    try:
        Recipe.named(text)
    except ValueError as error:
        raise ArgumentTypeError(str(error)) from error
    return text


def _add_density(studies: Verbs) -> None:
    parser = add_study(studies, "density", density, "reconstruction quality against droplet density, Fig. 7")
    parser.add_argument("--sigma", type=width, action="append", help="blob width in voxel, repeatable; default 1.5")
    parser.add_argument("--iterations", type=count, help="of smart and mart without -N, 20 by default")
    _add_methods(parser, _EVERY_METHOD)
    parser.add_argument("--all", action="store_true", help="sigma 0.75, 1.27, 1.5 and 2")


def density(options: Namespace) -> dict[str, Any]:
    """``tomoshadow study density``."""
    from processing.studies.density import (
        ALL_SIGMAS_VOXEL,
        DensityStudy,
        density_figure,
        density_statements,
        density_study,
    )

    sigmas_voxel = ALL_SIGMAS_VOXEL if options.all else tuple(options.sigma or (1.5,))
    study = DensityStudy(sigmas_voxel=sigmas_voxel, recipes=_recipes(options))
    rows = collected(density_study(study), _density_line)
    progress(f"Q is mean-subtracted in windows of {study.window}^3 voxel at steps of {study.step}")
    result = report(options.out, "density", rows, density_figure(rows, study), density_statements(rows))
    return {**result, "window_voxel": study.window, "step_voxel": study.step, "mean_subtracted": True}


def _recipes(options: Namespace) -> "tuple[Recipe, ...]":
    from processing.studies.recipe import ALL_RECIPES, PAPER_ITERATIONS, PAPER_RECIPES, Recipe

    if not options.method and options.iterations is None:
        return ALL_RECIPES
    names = options.method or [recipe.method.value for recipe in PAPER_RECIPES]
    return tuple(Recipe.named(name, options.iterations or PAPER_ITERATIONS) for name in names)


def _density_line(row: "DensityRow") -> str:
    place = f"sigma {row.sigma_voxel:g}, {row.density_per_mm3:5.1f} droplets/mm3"
    return f"{place}, {row.method}: Q = {row.quality_factor:.3f}"


def _add_ghosts(studies: Verbs) -> None:
    parser = add_study(studies, "ghosts", ghosts, "found and ghost droplets against droplet density")
    parser.add_argument("--sigma", type=width, default=1.0, help="blob width in voxel")
    _add_methods(parser, _EVERY_METHOD)


def ghosts(options: Namespace) -> dict[str, Any]:
    """``tomoshadow study ghosts``."""
    from processing.studies.ghosts import (
        MAX_GHOSTS,
        MIN_FOUND,
        TARGET_DENSITY_PER_MM3,
        GhostStudy,
        ghost_figure,
        ghost_statements,
        ghost_study,
        meets_target,
    )
    from processing.studies.recipe import ALL_RECIPES, Recipe

    recipes = tuple(Recipe.named(name) for name in options.method) if options.method else ALL_RECIPES
    rows = collected(ghost_study(GhostStudy(sigma_voxel=options.sigma, recipes=recipes)), _ghost_line)
    result = report(options.out, "ghosts", rows, ghost_figure(rows), ghost_statements(rows))
    passed = meets_target(rows)
    if passed is None:
        return result
    limits = f">= {100 * MIN_FOUND:.0f} % found and <= {100 * MAX_GHOSTS:.0f} % ghosts"
    progress(f"SMART-20, {limits} up to {TARGET_DENSITY_PER_MM3:g} droplets/mm3: {'PASSED' if passed else 'FAILED'}")
    return {**result, "passed": passed}


def _ghost_line(row: "GhostRow") -> str:
    place = f"{row.density_per_mm3:5.1f} droplets/mm3, {row.method}, {row.threshold_rule}"
    return f"{place}: {100 * row.found:.1f} % found, {100 * row.ghosts:.1f} % ghosts"


def _add_average(studies: Verbs) -> None:
    parser = add_study(studies, "average", average, "mean of many shots of the hollow cone, Fig. 6")
    parser.add_argument("--shots", type=count, default=266, help="realisations of the spray")
    parser.add_argument("--binning", type=int, choices=(1, 2, 4), default=2, help="of pixels; 1 is the paper's")
    parser.add_argument("--seed", type=seed, default=0, help="of spray, dust and noise")


def average(options: Namespace) -> dict[str, Any]:
    """``tomoshadow study average``."""
    from processing.studies.average import (
        AverageStudy,
        average_figure,
        average_rows,
        average_statements,
        average_study,
        profile_rows,
    )
    from processing.studies.report import csv_text

    study = AverageStudy(shots=options.shots, binning=options.binning, seed=options.seed)
    with Bar() as bar:
        mean = average_study(study, lambda done: bar.step(done, study.shots, f"shot {done} of {study.shots}"))
    rows = average_rows(mean)
    result = report(options.out, "average", rows, average_figure(mean), average_statements(rows))
    profiles = options.out / "average-profiles.csv"
    profiles.write_text(csv_text(profile_rows(mean)), encoding="utf-8")
    return {**result, "profiles": str(profiles)}


def _add_residuals(studies: Verbs) -> None:
    parser = add_study(studies, "residuals", residuals, "back-projection error plane by plane, Fig. 3")
    parser.add_argument("--binning", type=int, choices=(1, 2), default=1, help="of pixels; 1 is the paper's")
    parser.add_argument("--seed", type=seed, default=0, help="of light, dust and noise")


def residuals(options: Namespace) -> dict[str, Any]:
    """``tomoshadow study residuals``."""
    from processing.studies.residuals import ResidualStudy, residual_figure, residual_statements, residual_study

    rows = collected(residual_study(ResidualStudy(binning=options.binning, seed=options.seed)), _residual_line)
    return report(options.out, "residuals", rows, residual_figure(rows), residual_statements(rows))


def _residual_line(row: "ResidualRow") -> str:
    error = f"{row.mean_error_px:.2g} px at {counted(row.n_points, 'point')}"
    return f"{row.view}, {row.points}, z = {row.z_mm:g} mm: {error}"


def _add_calibration(studies: Verbs) -> None:
    summary = "true errors of cameras, corners and self-calibration, beside their limits"
    parser = add_study(studies, "calibration", calibration, summary)
    parser.add_argument(
        "--density",
        type=positive,
        action="append",
        help="droplets/mm3 for self-calibration, repeatable; default 3.5, 7",
    )
    parser.add_argument("--shots", type=count, default=4, help="shots of droplets for self-calibration")
    parser.add_argument("--seed", type=seed, default=0, help="of all noise")


def calibration(options: Namespace) -> dict[str, Any]:
    """``tomoshadow study calibration``."""
    from processing.studies.calibration_errors import (
        all_kept,
        calibration_figure,
        calibration_line,
        calibration_statements,
        calibration_study,
    )
    from processing.studies.calibration_rows import CalibrationStudy

    study = CalibrationStudy(shots=options.shots, seed=options.seed)
    if options.density:
        study = replace(study, densities_per_mm3=tuple(options.density))
    rows = collected(calibration_study(study), calibration_line)
    result = report(options.out, "calibration", rows, calibration_figure(rows), calibration_statements(rows))
    progress(f"every figure within its limit: {'PASSED' if all_kept(rows) else 'FAILED'}")
    return {**result, "passed": all_kept(rows)}


def _add_sensitivity(studies: Verbs) -> None:
    summary = "what calibration error, number and spread of views, and noise do to droplets found"
    parser = add_study(studies, "sensitivity", sensitivity, summary)
    parser.add_argument("--density", type=positive, default=13.8, help="droplets per mm^3")
    parser.add_argument("--sigma", type=width, default=1.0, help="blob width in voxel")
    parser.add_argument("--repeats", type=count, default=3, help="realisations to average")
    _add_methods(parser, "mlos and smart-10")


def sensitivity(options: Namespace) -> dict[str, Any]:
    """``tomoshadow study sensitivity``."""
    from processing.studies.recipe import Recipe
    from processing.studies.sensitivity import (
        SensitivityStudy,
        sensitivity_figure,
        sensitivity_statements,
        sensitivity_study,
    )

    study = SensitivityStudy(density_per_mm3=options.density, sigma_voxel=options.sigma, repeats=options.repeats)
    if options.method:
        study = replace(study, recipes=tuple(Recipe.named(name) for name in options.method))
    rows = collected(sensitivity_study(study), _sensitivity_line)
    return report(options.out, "sensitivity", rows, sensitivity_figure(rows), sensitivity_statements(rows))


def _sensitivity_line(row: "SensitivityRow") -> str:
    place = f"{row.influence} {row.value:g}, {row.method}"
    return f"{place}: {100 * row.found:.1f} % found, {100 * row.ghosts:.1f} % ghosts"
