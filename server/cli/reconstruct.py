"""``tomoshadow reconstruct``: the shots of a run become volumes."""

import resource
from argparse import Namespace
from contextlib import closing
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from daq.counted import counted
from processing.reconstruction.choices import VoxelType
from server.cli.chosen_shots import selected_shots
from server.cli.cluster.scheduler_option import add_scheduler, require_followed, shots_elsewhere
from server.cli.options import (
    OPTIONS,
    Verbs,
    add_choice,
    add_out,
    add_reconstruction,
    add_verb,
    calibrated_share,
    describe_grid,
    reconstruction_settings,
    usable_processors,
)
from server.cli.output import Outcome, progress, table, tracked
from server.cli.runs.batch import add_runs, over_runs
from server.cli.runs.belonging import Belonging, ask_droplets, ask_seldom
from server.cli.runs.faults import tell_faults
from server.cli.runs.recipes import add_recipe, keeping_recipe, settings_of, with_grid
from server.cli.runs.resuming import resumable

if TYPE_CHECKING:
    from collections.abc import Generator, Mapping, Sequence

    from processing.reconstruction.settings import ReconstructionSettings
    from processing.runs.results_file import ExposureKey
    from processing.runs.shots.meetings import Meetings
    from processing.runs.shots.shot_result import ShotResult

NAME = "reconstruct"
STATED = {"method", "accuracy", "voxels", "grid", "minimum_window_px", "noise_floor"}
"""Settings that are told with the result."""
MOST_COMPARED = 100
"""Volumes that were there before."""


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, NAME, reconstruct, "turn the shots of a run into volumes")
    add_runs(parser)
    parser.add_argument("--calibration", type=Path, required=True)
    add_recipe(parser)
    add_out(parser, "directory of the results; further shots of the same settings may join them")
    add_reconstruction(parser)
    summary = "how volumes are stored: float16 keeps 11 bits in half the file of float32, uint8 256 steps"
    add_choice(parser, "voxels", VoxelType, summary)
    add_scheduler(parser)


def reconstruct(options: Namespace) -> Outcome:
    """Reconstruct run by run, shot by shot."""
    from processing.calibration.calibration_file import load_calibration
    from processing.reconstruction.settings import METHOD_VERSION, ReconstructionSettings

    require_followed(options)
    calibration = load_calibration(options.calibration)
    command = (NAME, METHOD_VERSION)
    said = settings_of(
        options,
        command,
        ReconstructionSettings,
        (*OPTIONS, "grid"),
        lambda: reconstruction_settings(options, calibration),
    )
    settings = with_grid(said, calibration)
    share = calibrated_share(options, settings, calibration)
    with keeping_recipe(options, command, settings):
        return over_runs(options, lambda run_dir, out: _reconstruct_run(options, settings, share, run_dir, out))


def _reconstruct_run(
    options: Namespace, settings: "ReconstructionSettings", share: float, run_dir: Path, place: Path
) -> Outcome:
    from daq.files.run_directory import RunReader
    from processing.runs.overwriting import replacing, require_free
    from processing.runs.results_file import SETTINGS_FILE, volume_path
    from processing.runs.shots.shot_images import frame_names

    indices = selected_shots(run_dir, options.shots)
    with RunReader(run_dir) as run:
        frames = frame_names(run)
    volumes = [volume_path(place, index, frame) for index in indices for frame in frames]
    if options.overwrite:
        require_free(place, overwrite=True, made_with=(SETTINGS_FILE,))
        with replacing(place) as out:
            shots, belonging = _reconstruct_shots(options, settings, run_dir, indices, out)
    else:
        require_free(*volumes, overwrite=False)
        with resumable(place, indices, lambda index: [volume_path(place, index, frame) for frame in frames]):
            shots, belonging = _reconstruct_shots(options, settings, run_dir, indices, place)
    result = _result(settings, share, shots, belonging)
    told = (f"{place}: {_summary(result)}", result["light"], belonging.text)
    return Outcome(result, "\n".join([_volumes_table(result), *filter(None, told)]))


def _result(
    settings: "ReconstructionSettings", share: float, shots: "list[ShotResult]", belonging: Belonging
) -> dict[str, Any]:
    from processing.reconstruction.settings import METHOD_VERSION
    from processing.runs.recipe import recipe_sha256
    from processing.runs.shots.shot_light import light_line

    return {
        "passed": belonging.passed,
        **settings.model_dump(mode="json", include=STATED),
        "recipe_sha256": recipe_sha256(NAME, METHOD_VERSION, settings),
        "calibrated_share": share,
        "belonging": belonging.record(),
        "light": light_line({key: one for shot in shots for key, one in shot.light.items()}, settings),
        "views": {name: view.model_dump() for name, view in shots[0].views.items()},
        "volumes": [volume.model_dump(mode="json") for shot in shots for volume in shot.volumes],
        "cpu_s": sum(shot.cpu_s for shot in shots),
        "peak_rss_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def _reconstruct_shots(
    options: Namespace, settings: "ReconstructionSettings", run_dir: Path, indices: list[int], out: Path
) -> "tuple[list[ShotResult], Belonging]":
    from processing.calibration.calibration_file import load_calibration
    from processing.runs.shots.meetings import pale_views, seldom_meeting
    from processing.runs.volumes.pipeline import Options, reconstruct_shots

    calibration = load_calibration(options.calibration)

    @cache
    def belonging() -> Belonging:
        return ask_droplets(run_dir, indices, calibration)

    shots: list[ShotResult] = []
    if options.scheduler:
        coming = _elsewhere(options, settings, run_dir, indices, out, belonging())
    else:
        known: Options = {"threads": usable_processors(), "told": lambda: belonging().provenance}
        coming = reconstruct_shots(run_dir, indices, options.calibration, settings, out, **known)
    with closing(coming):
        for _ in tracked(indices, lambda index: f"{run_dir.name}: shot {index} by {settings.method}"):
            shot = next(coming)
            if not shots:
                _tell_slow_views(shot)
            _tell_faults(shot)
            shots.append(shot)
    meetings = _meetings(shots, out)
    pale, seldom = pale_views(meetings), [shot for shot in seldom_meeting(meetings) if shot in indices]
    return [_with_pale(shot, pale) for shot in shots], ask_seldom(belonging(), seldom, run_dir, calibration)


def _meetings(shots: "Sequence[ShotResult]", out: Path) -> "Meetings":
    """Of the exposures that were reconstructed now, and of some that lay there before."""
    from processing.runs.results_file import volume_files
    from processing.runs.shots.meetings import stored_meetings
    from processing.runs.stored_exposures import stored_exposures

    made = {volume.file for shot in shots for volume in shot.volumes}
    others = [file for file in volume_files(out) if file.name not in made][-MOST_COMPARED:]
    now = {key: one for shot in shots for key, one in shot.meetings.items()}
    return stored_meetings(stored_exposures(others)) | now


def _elsewhere(
    options: Namespace,
    settings: "ReconstructionSettings",
    run_dir: Path,
    indices: list[int],
    out: Path,
    belonging: Belonging,
) -> "Generator[ShotResult, None, None]":
    from processing.calibration.verdict import BELONGING
    from processing.runs.shots.shot_result import ShotResult
    from server.lab.tasks import reconstruct as task

    job = {"settings": settings.model_dump(mode="json"), "keep": "volume alone", BELONGING: belonging.record()}
    with closing(shots_elsewhere(options, task, run_dir, indices, out, job)) as coming:
        yield from map(ShotResult.model_validate, coming)


def _tell_slow_views(shot: "ShotResult") -> None:
    for name, view in shot.views.items():
        if view.reason:
            nodes = f"nodes {view.node_spacing_voxel} voxels apart"
            progress(f"{name} takes the exact way, which is slower ({nodes}): {view.reason}")


def _with_pale(shot: "ShotResult", pale: "Mapping[ExposureKey, Mapping[str, str]]") -> "ShotResult":
    """The same shot, with what the others say of its views, which is told."""
    volumes = []
    for volume in shot.volumes:
        views = pale.get((volume.shot, volume.frame), {})
        tell_faults(f"shot {volume.shot}, exposure {volume.frame}", {"odd_light": views})
        volumes.append(volume.model_copy(update={"odd_light": {**views, **volume.odd_light}}))
    return shot.model_copy(update={"volumes": tuple(volumes)})


def _tell_faults(shot: "ShotResult") -> None:
    for volume in shot.volumes:
        tell_faults(f"shot {volume.shot}, exposure {volume.frame}", volume.model_dump())


def _volumes_table(result: dict[str, Any]) -> str:
    """A line per volume, for people."""
    rows = [
        [str(volume["shot"]), volume["frame"].upper(), f"{volume['seconds']:.2f}", volume["file"]]
        for volume in result["volumes"]
    ]
    return table(["shot", "exposure", "seconds", "file"], rows)


def _summary(result: dict[str, Any]) -> str:
    grid = describe_grid(result["grid"]["shape"], result["grid"]["pitch_mm"])
    cost = f"{result['cpu_s']:.1f} CPU-s, at most {result['peak_rss_mb']:.0f} MB"
    return f"{counted(len(result['volumes']), 'volume')} by {result['method']}, {grid}; {cost}"
