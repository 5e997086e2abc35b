"""``tomoshadow measure``: the shots of a run become droplets."""

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from server.cli.options import (
    Verbs,
    add_calibrated_run,
    add_out,
    add_shots,
    add_verb,
    describe_grid,
    parse_grid,
    seed,
    selected_shots,
    usable_processors,
)
from server.cli.output import Outcome, progress, table, tracked

if TYPE_CHECKING:
    from processing.calibration.calibration import Calibration
    from processing.reconstruction.settings import GridSettings
    from processing.runs.measurement import MeasuredShot, MeasureSettings


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, "measure", measure, "measure the droplets in the shots of a run")
    add_calibrated_run(parser)
    add_out(parser, "directory of the results; further shots of the same settings may join them")
    add_shots(parser)
    parser.add_argument("--polarity", choices=("shadow", "bright"), help="default: as the run is recorded")
    parser.add_argument(
        "--grid",
        metavar="X0:X1,Y0:Y1,Z0:Z1",
        help="box in mm; default: the largest that all views see where they are calibrated",
    )
    parser.add_argument(
        "--twins", type=seed, default=0, metavar="N", help="simulated twins per exposure that tell ghosts; default none"
    )


def measure(options: Namespace) -> Outcome:
    """Measure shot by shot."""
    from daq.files.run_directory import RunReader
    from processing.calibration.calibration_file import load_calibration
    from processing.runs.measurement import MeasureSettings, droplets_path, require_measurable
    from processing.runs.overwriting import replacing, require_free
    from processing.runs.results_file import SETTINGS_FILE

    calibration = load_calibration(options.calibration)
    with RunReader(options.run) as run:
        recorded = run.header.polarity
    polarity = options.polarity or recorded
    require_measurable(options.run.name, recorded, polarity)
    settings = MeasureSettings(polarity=polarity, grid=_grid(options, calibration), twins=options.twins)
    indices = selected_shots(options.run, options.shots)
    if options.overwrite:
        require_free(options.out, overwrite=True, made_with=(SETTINGS_FILE,))
        with replacing(options.out) as out:
            result = _measure_shots(options, settings, indices, out)
    else:
        require_free(*(droplets_path(options.out, index) for index in indices), overwrite=False)
        result = _measure_shots(options, settings, indices, options.out)
    return Outcome(result, f"{droplets_table(result)}\n{options.out}: {_summary(result)}")


def _grid(options: Namespace, calibration: "Calibration") -> "GridSettings | None":
    from processing.reconstruction.settings import GridSettings

    return GridSettings.of(parse_grid(options.grid, calibration)) if options.grid else None


def _measure_shots(options: Namespace, settings: "MeasureSettings", indices: list[int], out: Path) -> dict[str, Any]:
    from daq.files.run_directory import RunReader
    from processing.analysis.droplets.droplet_file import read_droplets
    from processing.analysis.droplets.droplet_statistics import droplet_statistics
    from processing.reconstruction.settings import GridSettings
    from processing.runs.measurement import RunMeasurement

    with RunReader(options.run) as run:
        measurement = RunMeasurement.of(run, indices[0], options.calibration, settings)
        shots: list[MeasuredShot] = []
        for index in tracked(indices, lambda index: f"{options.run.name}: shot {index}"):
            shots.append(measurement.measure(index, out, usable_processors()))
            _tell_faults(shots[-1])
    statistics = droplet_statistics([read_droplets(out / shot.summary.file) for shot in shots])
    return {
        "polarity": settings.polarity,
        "grid": GridSettings.of(measurement.search.grid).model_dump(mode="json"),
        "shots": [shot.summary.model_dump(mode="json") for shot in shots],
        "statistics": statistics.model_dump(mode="json"),
        "passed": any(shot.summary.verdict != "refused" for shot in shots),
    }


def _tell_faults(shot: "MeasuredShot") -> None:
    for reason in shot.summary.reasons:
        progress(f"shot {shot.summary.shot}: {shot.summary.verdict}: {reason}")


def droplets_table(result: dict[str, Any]) -> str:
    """A line per shot, for people."""
    rows = [
        [
            str(shot["shot"]),
            str(shot["droplets"]),
            _number(shot["residual_over_noise"], 3),
            "" if shot["ghost_share"] is None else f"{100 * shot['ghost_share']:.2f}",
            f"{shot['cpu_s']:.1f}",
            shot["verdict"],
            shot["file"],
        ]
        for shot in result["shots"]
    ]
    return table(["shot", "droplets", "residual/noise", "ghosts %", "CPU-s", "verdict", "file"], rows)


def _number(value: float | None, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f}"


def _summary(result: dict[str, Any]) -> str:
    statistics = result["statistics"]
    grid = describe_grid(result["grid"]["shape"], result["grid"]["pitch_mm"])
    if not statistics["exposures"]:
        return f"no shot could be measured, {grid}"
    counted = f"{statistics['n']} droplets in {statistics['exposures']} exposures"
    density = _with_interval(statistics["number_density_per_mm3"])
    d32 = f", D32 {_with_interval(statistics['d32_um'])} um" if statistics["d32_um"] else ""
    return f"{counted}, {density} per mm3{d32}, {grid}"


def _with_interval(estimate: dict[str, float]) -> str:
    return f"{estimate['value']:.3g} ({estimate['low']:.3g} to {estimate['high']:.3g})"
