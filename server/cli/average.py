"""``tomoshadow average``: the mean of stored volumes, or of a run whose volumes need not be stored."""

import json
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from daq.counted import counted
from processing.reconstruction.choices import VoxelType
from processing.runs.errors import PipelineError
from server.cli.chosen_shots import selected_shots
from server.cli.options import (
    Verbs,
    add_out,
    add_reconstruction,
    add_verb,
    calibrated_share,
    describe_grid,
    picture_beside,
    reconstruction_settings,
    run_directory,
    usable_processors,
)
from server.cli.output import Bar, Outcome, progress
from server.cli.runs.belonging import ask_droplets, ask_seldom, stored_belonging
from server.cli.runs.faults import tell_faults

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from processing.calibration.calibration import Calibration
    from processing.reconstruction.mean_line_of_sight import MeanVolume
    from processing.reconstruction.settings import ReconstructionSettings
    from processing.runs.results_file import Provenance
    from processing.runs.stored_exposures import StoredExposure
    from processing.runs.volumes.run_average import RunAverage
    from processing.runs.workbench import Workbench
    from processing.volume import VoxelGrid


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(
        verbs, "average", average, "mean volume and slices of results, or straight from the shots of a run"
    )
    parser.add_argument(
        "results", type=run_directory, help="directory of results; or a run or import, with --calibration"
    )
    add_out(parser, "volume file to write; slices beside it")
    parser.add_argument(
        "--exposure", choices=["a", "b"], default="a", help="of each shot, default a; A and B are never mixed"
    )
    parser.add_argument("--calibration", type=Path, help="of the run; no volume of a single exposure is stored")
    add_reconstruction(parser)
    parser.set_defaults(voxels=VoxelType.FLOAT32)  # a mean has finer steps than one exposure


def average(options: Namespace) -> Outcome:
    """Average what there is: volumes, or shots with a calibration."""
    from processing.runs.overwriting import require_free

    require_free(options.out, picture_beside(options.out), overwrite=options.overwrite)
    if options.calibration is None and (options.results / "run.h5").is_file():
        raise PipelineError(f"{options.results} is a run: name its --calibration to average it")
    result = _average_results(options) if options.calibration is None else _average_run(options)
    grid = describe_grid(result["grid"]["shape"], result["grid"]["pitch_mm"])
    what = f"mean of {counted(result['volumes'], 'volume')} of exposure {options.exposure.upper()}"
    text = f"{result['file']}: {what}, {grid}; slices in {result['figure']}"
    for one in result["faults"]:
        tell_faults(f"shot {one['shot']}, exposure {options.exposure}", one)
    if result["faults"]:
        all_of_them = counted(result["volumes"], "exposure")
        text += f"\n{len(result['faults'])} of {all_of_them} may be wrong, and are part of the mean"
    if result["light"]:
        text += f"\n{result['light']}"
    return Outcome(result, text)


def _average_results(options: Namespace) -> dict[str, Any]:
    from processing.calibration.verdict import BELONGING
    from processing.reconstruction.mean_line_of_sight import MeanVolume
    from processing.reconstruction.volume_file import VolumeFileError
    from processing.runs.exposure_faults import stored_faults
    from processing.runs.results_file import volume_files
    from processing.runs.shots.meetings import stored_meetings, with_odd
    from processing.runs.shots.shot_light import light_line, stored_settings, stored_shares
    from processing.runs.volumes.stored_average import average_volumes

    files = volume_files(options.results, options.exposure)
    if not files:
        raise VolumeFileError(
            f"{options.results}: there are no volumes of exposure {options.exposure.upper()} to average; the server "
            "keeps previews: name the run and its --calibration"
        )
    averaged = average_volumes(files)
    mean, grid, exposures = MeanVolume.of(averaged.mean), averaged.grid, averaged.exposures
    told = [told for one in exposures if (told := stored_faults(one, averaged.copies.get(one.file)))]
    faults = with_odd(told, stored_meetings(exposures))
    light = light_line(stored_shares(exposures), stored_settings(exposures[0]))
    belonging = _told_belonging(options.results, exposures)
    made_by = {BELONGING: json.dumps(belonging)} if belonging else {}
    written = _written(options, mean, grid, len(files), faults, made_by)
    told_of_it = {"passed": belonging["verdict"] != "refuse", "belonging": belonging} if belonging else {}
    return {**told_of_it, **written, "light": light}


def _told_belonging(results: Path, exposures: "Sequence[StoredExposure]") -> dict[str, Any] | None:
    """The worst record that the volumes carry; where it speaks against them, a person is told."""
    belonging = stored_belonging(exposures)
    if belonging and belonging["verdict"] in ("warn", "refuse"):
        progress(f"{results}: droplets speak against calibration and run: {belonging['verdict']}")
    return belonging


def _average_run(options: Namespace) -> dict[str, Any]:
    from processing.calibration.calibration_file import load_calibration
    from processing.reconstruction.settings import METHOD_VERSION
    from processing.runs.shots.shot_light import light_line
    from processing.runs.workbench import Workbench

    calibration = load_calibration(options.calibration)
    settings = reconstruction_settings(options, calibration)
    shots = selected_shots(options.results, options.shots)
    share, workbench = calibrated_share(options, settings, calibration), Workbench()
    averaged = _averaged(options, shots, calibration, settings, workbench)
    belonging = ask_droplets(options.results, shots, calibration, workbench)
    belonging = ask_seldom(belonging, averaged.seldom, options.results, calibration, workbench)
    made_by: Provenance = {
        "calibration": calibration.id,
        "settings": settings.model_dump_json(),
        "method_version": METHOD_VERSION,
        **belonging.provenance,
    }
    written = _written(options, averaged.mean, averaged.grid, averaged.exposures, averaged.faults, made_by)
    progress(belonging.text)
    told = {"passed": belonging.passed, "belonging": belonging.record()}
    light = light_line(averaged.light, settings)
    return {**told, **written, "light": light, "method": settings.method.value, "calibrated_share": share}


def _averaged(
    options: Namespace,
    shots: list[int],
    calibration: "Calibration",
    settings: "ReconstructionSettings",
    workbench: "Workbench",
) -> "RunAverage":
    from processing.runs.volumes.run_average import average_run

    with Bar() as bar:
        return average_run(
            options.results,
            shots,
            calibration,
            settings,
            lambda done, of: bar.step(done, of, f"{options.results.name}: {counted(done, 'exposure')}"),
            frame=options.exposure,
            threads=usable_processors(),
            workbench=workbench,
        )


def _written(
    options: Namespace,
    mean: "MeanVolume",
    grid: "VoxelGrid",
    count: int,
    faults: "Sequence[Mapping[str, Any]]",
    made_by: "Provenance",
) -> dict[str, Any]:
    from processing.figures.volume_figures import look_figure
    from processing.figures.volume_look import GrowingLook
    from processing.reconstruction.settings import GridSettings
    from processing.reconstruction.slab_volume import SlabVolume
    from processing.reconstruction.volume_file import write_slabs
    from processing.reconstruction.volume_part import Part
    from processing.runs.overwriting import replacing

    source: Provenance = {"average_of": str(options.results), "frame": options.exposure, "volumes": count}
    told: Provenance = {"faults": json.dumps(faults)} if faults else {}
    figure = picture_beside(options.out)
    with replacing(options.out) as out:
        look = GrowingLook(grid.shape)
        volume = SlabVolume(look.watching(mean.slabs()), VoxelType.FLOAT32, 1.0)
        write_slabs(out, volume, grid, {**source, **told, **made_by}, threads=usable_processors())
        seen = look.look(lambda axis, index: mean.part(Part.plane(grid, axis, index)).squeeze(axis))
        drawn = look_figure(seen, grid, f"mean of {counted(count, 'volume')}")
        drawn.savefig(out.with_name(figure.name), dpi=120)
    return {
        "file": str(options.out),
        "figure": str(figure),
        "exposure": options.exposure,
        "volumes": count,
        "faults": list(faults),
        "grid": GridSettings.of(grid).model_dump(),
    }
