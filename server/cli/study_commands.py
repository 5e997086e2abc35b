"""``tomoshadow study``: each study writes CSV and figure, and says what the paper says beside what it found."""

import time
from argparse import Namespace
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, replace
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar

from matplotlib.figure import Figure

from processing.studies.accuracy_report import accuracy_figure, accuracy_line, accuracy_statements, all_kept
from processing.studies.accuracy_study import CalibrationStudy
from processing.studies.average import (
    AverageStudy,
    average_figure,
    average_rows,
    average_statements,
    average_study,
    profile_rows,
)
from processing.studies.calibration_accuracy import calibration_study
from processing.studies.density import (
    ALL_SIGMAS_VOXEL,
    DensityRow,
    DensityStudy,
    density_figure,
    density_statements,
    density_study,
)
from processing.studies.ghosts import (
    MAX_GHOSTS,
    MIN_FOUND,
    TARGET_DENSITY_PER_MM3,
    GhostRow,
    GhostStudy,
    ghost_figure,
    ghost_statements,
    ghost_study,
    meets_target,
)
from processing.studies.recipe import ALL_RECIPES, PAPER_ITERATIONS, PAPER_RECIPES, Recipe
from processing.studies.report import Statement, csv_text
from processing.studies.residuals import (
    ResidualRow,
    ResidualStudy,
    residual_figure,
    residual_statements,
    residual_study,
)
from processing.studies.sensitivity import (
    SensitivityRow,
    SensitivityStudy,
    sensitivity_figure,
    sensitivity_statements,
    sensitivity_study,
)
from server.cli.commands import progress

Row = TypeVar("Row")
Command = Callable[[Namespace], dict[str, Any]]


def timed(study: Command) -> Command:
    """Say how long a study took; complain of a directory that cannot be written to before, not after."""

    @wraps(study)
    def run(options: Namespace) -> dict[str, Any]:
        options.out.mkdir(parents=True, exist_ok=True)
        wall_s, cpu_s = time.perf_counter(), time.process_time()
        result = study(options)
        seconds = {"wall": time.perf_counter() - wall_s, "cpu": time.process_time() - cpu_s}
        progress(f"took {seconds['wall']:.0f} s, {seconds['cpu']:.0f} CPU-s")
        return {**result, "seconds": seconds}

    return run


@timed
def study_density(options: Namespace) -> dict[str, Any]:
    """``tomoshadow study density``."""
    sigmas_voxel = ALL_SIGMAS_VOXEL if options.all else tuple(options.sigma or (1.5,))
    study = DensityStudy(sigmas_voxel=sigmas_voxel, recipes=_recipes(options))
    rows = _collected(density_study(study), _density_line)
    progress(f"Q is mean-subtracted in windows of {study.window}^3 voxel at steps of {study.step}")
    result = _report(options.out, "density", rows, density_figure(rows, study), density_statements(rows))
    return {**result, "window_voxel": study.window, "step_voxel": study.step, "mean_subtracted": True}


def _density_line(row: DensityRow) -> str:
    place = f"sigma {row.sigma_voxel:g}, {row.density_per_mm3:5.1f} droplets/mm3"
    return f"{place}, {row.method}: Q = {row.quality_factor:.3f}"


@timed
def study_ghosts(options: Namespace) -> dict[str, Any]:
    """``tomoshadow study ghosts``."""
    recipes = tuple(Recipe.named(name) for name in options.method) if options.method else ALL_RECIPES
    rows = _collected(ghost_study(GhostStudy(sigma_voxel=options.sigma, recipes=recipes)), _ghost_line)
    result = _report(options.out, "ghosts", rows, ghost_figure(rows), ghost_statements(rows))
    passed = meets_target(rows)
    if passed is None:
        return result
    limits = f">= {100 * MIN_FOUND:.0f} % found and <= {100 * MAX_GHOSTS:.0f} % ghosts"
    progress(f"SMART-20, {limits} up to {TARGET_DENSITY_PER_MM3:g} droplets/mm3: {'PASSED' if passed else 'FAILED'}")
    return {**result, "passed": passed}


def _ghost_line(row: GhostRow) -> str:
    place = f"{row.density_per_mm3:5.1f} droplets/mm3, {row.method}, {row.threshold_rule}"
    return f"{place}: {100 * row.found:.1f} % found, {100 * row.ghosts:.1f} % ghosts"


@timed
def study_average(options: Namespace) -> dict[str, Any]:
    """``tomoshadow study average``."""
    study = AverageStudy(shots=options.shots, binning=options.binning, seed=options.seed)
    mean = average_study(study, lambda done: progress(f"shot {done} of {study.shots}"))
    rows = average_rows(mean)
    result = _report(options.out, "average", rows, average_figure(mean), average_statements(rows))
    profiles = options.out / "average-profiles.csv"
    profiles.write_text(csv_text(profile_rows(mean)), encoding="utf-8")
    return {**result, "profiles": str(profiles)}


@timed
def study_residuals(options: Namespace) -> dict[str, Any]:
    """``tomoshadow study residuals``."""
    rows = _collected(residual_study(ResidualStudy(binning=options.binning, seed=options.seed)), _residual_line)
    return _report(options.out, "residuals", rows, residual_figure(rows), residual_statements(rows))


def _residual_line(row: ResidualRow) -> str:
    return f"{row.view}, {row.points}, z = {row.z_mm:g} mm: {row.mean_error_px:.2g} px at {row.n_points} points"


@timed
def study_calibration(options: Namespace) -> dict[str, Any]:
    """``tomoshadow study calibration``."""
    study = CalibrationStudy(shots=options.shots, seed=options.seed)
    if options.density:
        study = replace(study, densities_per_mm3=tuple(options.density))
    rows = _collected(calibration_study(study), accuracy_line)
    result = _report(options.out, "calibration", rows, accuracy_figure(rows), accuracy_statements(rows))
    progress(f"every figure within its limit: {'PASSED' if all_kept(rows) else 'FAILED'}")
    return {**result, "passed": all_kept(rows)}


@timed
def study_sensitivity(options: Namespace) -> dict[str, Any]:
    """``tomoshadow study sensitivity``."""
    study = SensitivityStudy(density_per_mm3=options.density, sigma_voxel=options.sigma, repeats=options.repeats)
    if options.method:
        study = replace(study, recipes=tuple(Recipe.named(name) for name in options.method))
    rows = _collected(sensitivity_study(study), _sensitivity_line)
    return _report(options.out, "sensitivity", rows, sensitivity_figure(rows), sensitivity_statements(rows))


def _sensitivity_line(row: SensitivityRow) -> str:
    place = f"{row.influence} {row.value:g}, {row.method}"
    return f"{place}: {100 * row.found:.1f} % found, {100 * row.ghosts:.1f} % ghosts"


def _recipes(options: Namespace) -> tuple[Recipe, ...]:
    if not options.method and options.iterations is None:
        return ALL_RECIPES
    names = options.method or [recipe.method.value for recipe in PAPER_RECIPES]
    return tuple(Recipe.named(name, options.iterations or PAPER_ITERATIONS) for name in names)


def _collected(rows: Iterable[Row], line: Any) -> list[Row]:
    collected = []
    for row in rows:
        progress(line(row))
        collected.append(row)
    return collected


def _report(
    out: Path, name: str, rows: Sequence[Any], figure: Figure, statements: Sequence[Statement]
) -> dict[str, Any]:
    """Write CSV and figure; the JSON object of the study."""
    csv, picture = out / f"{name}.csv", out / f"{name}.png"
    csv.write_text(csv_text(rows), encoding="utf-8")
    figure.savefig(picture, dpi=150)
    for statement in statements:
        progress(str(statement))
    return {
        "csv": str(csv),
        "figure": str(picture),
        "rows": [asdict(row) for row in rows],
        "statements": [asdict(statement) for statement in statements],
    }
