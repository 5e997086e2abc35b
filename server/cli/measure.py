"""``tomoshadow measure``: the shots of runs become droplets; images without calibration: ``runs.single_view``."""

from argparse import ArgumentTypeError, Namespace
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from server.cli.chosen_shots import selected_shots
from server.cli.cluster.scheduler_option import add_scheduler, require_followed, shots_elsewhere
from server.cli.light_option import add_light
from server.cli.options import Verbs, add_out, add_shots, add_verb, setting, usable_processors
from server.cli.output import Outcome, progress, tracked
from server.cli.runs.batch import add_runs, over_runs
from server.cli.runs.export_option import add_export
from server.cli.runs.measured_text import droplets_summary, droplets_table
from server.cli.runs.recipes import add_recipe, keeping_recipe, settings_of, with_grid
from server.cli.runs.resuming import resumable
from server.cli.runs.single_view import IN_THE_IMAGE, add_single_view, measure_single_view, refuse

if TYPE_CHECKING:
    from collections.abc import Generator

    from processing.calibration.calibration import Calibration
    from processing.preprocessing import Polarity
    from processing.runs.droplets.measure_settings import MeasureSettings
    from processing.runs.droplets.measured_shot import ShotDroplets

NAME = "measure"
SAID = ("polarity", "grid", "twins", "light", "sizes", "ignore", "nozzle")
"""Options that a recipe takes the place of."""


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, NAME, measure, "measure the droplets in the shots of runs")
    add_runs(parser)
    parser.add_argument("--calibration", type=Path, help="of the views; without it, droplets are measured in 2-D")
    add_recipe(parser)
    add_out(parser, "directory of the results; further shots of the same settings may join them")
    add_shots(parser)
    parser.add_argument("--polarity", choices=("shadow", "bright"), help="default: as the run is recorded")
    parser.add_argument(
        "--grid",
        metavar="X0:X1,Y0:Y1,Z0:Z1[@PITCH]",
        help="box in mm, voxel edge in mm; default: the largest that all views see and are calibrated in",
    )
    parser.add_argument(
        "--twins",
        type=_twins,
        metavar="N",
        help="simulated twins per exposure in which ghosts are counted, a witness; default none",
    )
    add_light(parser)
    parser.add_argument(
        "--sizes", type=Path, metavar="FILE", help="of shadows: calibration of sizes, as size-calibration writes it"
    )
    parser.add_argument(
        "--ignore",
        action="append",
        type=_ignored,
        metavar="VIEW=LEFT:RIGHT,TOP:BOTTOM",
        help="pixels of a view that are not asked, as a nozzle or a reflection; may be repeated",
    )
    parser.add_argument(
        "--nozzle",
        type=_nozzle,
        metavar="X,Y,Z[,AX,AY,AZ]",
        help="of shadows: orifice in mm and axis of the spray, for the break-up length; default: [spray] of the run",
    )
    add_export(parser, "droplets")
    add_scheduler(parser)
    add_single_view(parser)


def _twins(text: str) -> int:
    from processing.runs.droplets.measure_settings import MeasureSettings

    return int(setting("twins", text, MeasureSettings))


def _ignored(text: str) -> str:
    from processing.runs.errors import PipelineError
    from processing.runs.measured_images import rectangle

    try:
        rectangle(text)
    except PipelineError as error:
        raise ArgumentTypeError(str(error)) from error
    return text


def _nozzle(text: str) -> tuple[float, ...]:
    from processing.runs.liquid.objects import place_and_axis

    try:
        return place_and_axis(tuple(float(number) for number in text.split(",")))
    except ValueError as error:
        raise ArgumentTypeError(f"{text}: {error}") from error


def measure(options: Namespace) -> Outcome:
    """Measure run by run, shot by shot."""
    from processing.calibration.calibration_file import load_calibration
    from processing.runs.droplets.measure_settings import METHOD_VERSION, MeasureSettings

    for export in options.export:
        export.require()
    require_followed(options)
    if options.calibration is None:
        return measure_single_view(options)
    refuse(options, IN_THE_IMAGE, "is for droplets in 2-D, without --calibration")
    calibration = load_calibration(options.calibration)
    command = (NAME, METHOD_VERSION)
    said = settings_of(options, command, MeasureSettings, SAID, lambda: _by_options(options, calibration))
    settings = with_grid(said, calibration)
    with keeping_recipe(options, command, settings):
        return over_runs(options, lambda run_dir, out: _measure_run(options, settings, run_dir, out))


def _polarity(run_dir: Path) -> "Polarity":
    from daq.files.run_directory import RunReader

    with RunReader(run_dir) as run:
        return run.header.polarity


def _by_options(options: Namespace, calibration: "Calibration") -> "MeasureSettings":
    from processing.reconstruction.settings import GridSettings
    from processing.runs.droplets.measure_settings import MeasureSettings
    from processing.runs.stated_grid import parse_grid

    grid = GridSettings.of(parse_grid(options.grid, calibration)) if options.grid else None
    polarity = options.polarity or _polarity(options.runs[0])
    ignored = tuple(options.ignore or ())
    return MeasureSettings(
        polarity=polarity,
        grid=grid,
        twins=options.twins or 0,
        ignored=ignored,
        nozzle=options.nozzle,
        **_light_and_sizes(options, calibration),
    )


def _light_and_sizes(options: Namespace, calibration: "Calibration") -> dict[str, Any]:
    """The light that is stated, or that in which a reticle was measured, with the sizes of its dots."""
    from processing.runs.errors import PipelineError
    from processing.runs.reticle.size_calibration import load_size_calibration

    if options.sizes is None:
        return {"light": options.light or "estimated"}
    found = load_size_calibration(options.sizes)
    if options.light not in (None, found.light):
        raise PipelineError(
            f"--light {options.light}: {options.sizes} was measured in light {found.light}; leave it out"
        )
    if found.calibration != calibration.id:
        progress(
            f"{options.sizes}: its reticle was measured by {found.calibration}, these runs are by {calibration.id}: "
            "sizes hold for the same lenses, focus and light"
        )
    return {"light": found.light, "sizes": found.rows}


def _measure_run(options: Namespace, settings: "MeasureSettings", run_dir: Path, place: Path) -> Outcome:
    from processing.analysis.exports.export import export_path
    from processing.runs.droplets.measure_settings import require_measurable
    from processing.runs.droplets.measured_shot import droplets_path
    from processing.runs.overwriting import replacing, require_free
    from processing.runs.results_file import SETTINGS_FILE

    require_measurable(run_dir.name, _polarity(run_dir), settings)
    indices = selected_shots(run_dir, options.shots)
    if options.overwrite:
        require_free(place, overwrite=True, made_with=(SETTINGS_FILE,))
        with replacing(place) as out:
            result = _measure_shots(options, settings, run_dir, indices, out)
    else:
        files = [droplets_path(place, index) for index in indices]
        require_free(*files, *(export_path(file, kind) for file in files for kind in options.export), overwrite=False)
        with resumable(place, indices, lambda index: [droplets_path(place, index)]):
            result = _measure_shots(options, settings, run_dir, indices, place)
    return Outcome(result, f"{droplets_table(result)}\n{place}: {droplets_summary(result)}")


def _measure_shots(
    options: Namespace, settings: "MeasureSettings", run_dir: Path, indices: list[int], out: Path
) -> dict[str, Any]:
    from processing.analysis.exports.export import export_droplets

    shots: list[ShotDroplets] = []
    with closing((_elsewhere if options.scheduler else _here)(options, settings, run_dir, indices, out)) as coming:
        for _ in tracked(indices, lambda index: f"{run_dir.name}: shot {index}"):
            shots.append(next(coming))
            for export in options.export:
                export_droplets(out / shots[-1].file, export)
            _tell_faults(shots[-1])
    return _result(settings, shots, [out / shot.file for shot in shots])


def _result(settings: "MeasureSettings", shots: "list[ShotDroplets]", files: list[Path]) -> dict[str, Any]:
    """What the shots say together, of which people are told what casts doubt, and what nothing checks."""
    from processing.analysis.droplets.droplet_file import read_droplets
    from processing.analysis.droplets.droplet_statistics import droplet_statistics
    from processing.analysis.velocity.velocity_statistics import velocity_statistics
    from processing.runs.droplets.measure_settings import METHOD_VERSION
    from processing.runs.droplets.told_together import told_together
    from processing.runs.liquid.objects import liquid_summary
    from processing.runs.recipe import recipe_sha256

    stored = [read_droplets(file) for file in files]
    together = told_together(stored, files)
    for told in (*together.doubts, *(one.text for one in together.not_checked)):
        progress(told)
    return {
        **together.model_dump(mode="json"),
        "polarity": settings.polarity,
        "recipe_sha256": recipe_sha256(NAME, METHOD_VERSION, settings),
        "grid": settings.model_dump(mode="json")["grid"],
        "shots": [shot.model_dump(mode="json") for shot in shots],
        "statistics": droplet_statistics(stored).model_dump(mode="json"),
        "velocity": velocity_statistics(stored).model_dump(mode="json"),
        **liquid_summary(stored).model_dump(mode="json"),
        "passed": any(shot.verdict != "refused" for shot in shots),
    }


def _here(
    options: Namespace, settings: "MeasureSettings", run_dir: Path, indices: list[int], out: Path
) -> "Generator[ShotDroplets, None, None]":
    from daq.files.run_directory import RunReader
    from processing.runs.droplets.measurement import RunMeasurement

    with RunReader(run_dir) as run:
        measurement = RunMeasurement.of(run, indices[0], options.calibration, settings)
        for index in indices:
            yield measurement.measure(index, out, usable_processors()).summary


def _elsewhere(
    options: Namespace, settings: "MeasureSettings", run_dir: Path, indices: list[int], out: Path
) -> "Generator[ShotDroplets, None, None]":
    from processing.runs.droplets.measured_shot import ShotDroplets
    from server.lab.tasks import measure_shot

    job = {"settings": settings.model_dump(mode="json")}
    with closing(shots_elsewhere(options, measure_shot, run_dir, indices, out, job)) as coming:
        yield from map(ShotDroplets.model_validate, coming)


def _tell_faults(shot: "ShotDroplets") -> None:
    for reason in shot.reasons:
        progress(f"shot {shot.shot}: {shot.verdict}: {reason}")
    if velocity := shot.velocity:
        for reason in velocity.reasons:
            progress(f"shot {shot.shot}: velocities {velocity.verdict}: {reason}")
