"""``tomoshadow measure`` without a calibration: images, or one view of runs, become droplets in 2-D."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from daq.counted import counted
from processing.runs.errors import PipelineError
from server.cli.chosen_shots import selected_shots
from server.cli.options import positive
from server.cli.output import Outcome, progress, table, tracked
from server.cli.runs.batch import over_runs
from server.cli.runs.recipes import keeping_recipe, settings_of
from server.reports.digits import digits_of_interval

if TYPE_CHECKING:
    from collections.abc import Sequence

    from processing.analysis.flat.flat_settings import FlatSettings
    from processing.preprocessing import Polarity
    from processing.runs.results_file import Provenance
    from processing.runs.single_view.measurement import FlatShot
    from processing.runs.single_view.sources import FlatSource

IN_SPACE = ("grid", "twins", "light", "sizes", "ignore", "scheduler")
"""Options that need a calibration."""
IN_THE_IMAGE = ("view", "um_per_px", "background")
"""Options that mean nothing with one."""

OF_RUNS = ("view", "shots")
"""Options that mean nothing of images."""
LEAST_UM_PER_PX, MOST_UM_PER_PX = 0.05, 1e6
"""From pixels of an oil immersion lens to a metre; millimetres taken for micrometres are below."""


def add_single_view(parser: ArgumentParser) -> None:
    """Let a command be told of images without a calibration."""
    group = parser.add_argument_group("without --calibration, droplets in 2-D, of image files or one view of runs")
    group.add_argument("--view", metavar="NAME", help="of a run with several")
    group.add_argument("--um-per-px", type=_um_per_px, metavar="X", help="width of a pixel in the spray: um for px")
    group.add_argument("--background", type=Path, metavar="IMAGE", help="light without droplets; default: fitted")


def _um_per_px(text: str) -> float:
    if not LEAST_UM_PER_PX <= (value := positive(text)) <= MOST_UM_PER_PX:
        raise ArgumentTypeError(f"{text} must be from {LEAST_UM_PER_PX:g} to {MOST_UM_PER_PX:g}, in um")
    return value


def measure_single_view(options: Namespace) -> Outcome:
    """Measure image by image, or run by run.

    Raises
    ------
    PipelineError
        Images and runs at once, or options that need a calibration.
    """
    from processing.analysis.flat.flat_settings import FlatSettings
    from processing.runs.single_view.measurement import COMMAND, METHOD_VERSION
    from processing.runs.single_view.sources import image_origin, image_sources

    refuse(options, IN_SPACE, "needs --calibration")
    if any(not export.is_flat for export in options.export):
        raise PipelineError("--export vtk: needs --calibration, droplets of a single view have no place in space")
    images = [path for path in options.runs if not path.is_dir()]
    if images and len(images) < len(options.runs):
        raise PipelineError(f"{images[0]}: images and runs are not measured at once; take one after the other")
    command = (COMMAND, METHOD_VERSION)
    settings = settings_of(
        options, command, FlatSettings, ("polarity",), lambda: FlatSettings(polarity=_polarity(options, bool(images)))
    )
    if images:
        refuse(options, OF_RUNS, "is for runs; an image is a view and a shot by itself")
        sources = image_sources(images, options.background)
        with keeping_recipe(options, command, settings):
            return _measure(options, settings, sources, options.out, image_origin(images, options.background))
    refuse(options, ("background",), "is for images; a run has its own")
    with keeping_recipe(options, command, settings):
        return over_runs(options, lambda run_dir, out: _measure_run(options, settings, run_dir, out))


def refuse(options: Namespace, names: "Sequence[str]", why: str) -> None:
    """Refuse options that were given, with the reason."""
    if given := [f"--{name.replace('_', '-')}" for name in names if getattr(options, name) is not None]:
        raise PipelineError(f"{', '.join(given)}: {why}")


def _polarity(options: Namespace, images: bool) -> "Polarity":
    from daq.files.run_directory import RunReader

    said: Polarity | None = options.polarity
    if said or images:
        return said or "shadow"
    with RunReader(options.runs[0]) as run:
        return run.header.polarity


def _measure_run(options: Namespace, settings: "FlatSettings", run_dir: Path, out: Path) -> Outcome:
    from daq.files.run_directory import RunReader
    from processing.runs.single_view.sources import shot_sources
    from processing.runs.single_view.stated_scale import rig_um_per_px

    with RunReader(run_dir) as run:
        if run.header.polarity != settings.polarity:
            raise PipelineError(
                f"{run_dir.name}: its images are recorded as {run.header.polarity}, they are not measured as "
                f"{settings.polarity}"
            )
        sources = shot_sources(run, options.view, selected_shots(run_dir, options.shots))
        view = options.view or next(iter(run.header.views))
        origin: Provenance = {"run": run.header.run_id, "view": view}
        return _measure(options, settings, sources, out, origin, rig_um_per_px(run.header, view))


def _measure(
    options: Namespace,
    settings: "FlatSettings",
    sources: "list[FlatSource]",
    place: Path,
    origin: "Provenance",
    by_rig_um_per_px: float | None = None,
) -> Outcome:
    from processing.analysis.exports.export import export_path
    from processing.runs.overwriting import replacing, require_free
    from processing.runs.results_file import SETTINGS_FILE

    if options.overwrite:
        require_free(place, overwrite=True, made_with=(SETTINGS_FILE,))
        with replacing(place) as out:
            result = _measure_all(options, settings, sources, out, origin, by_rig_um_per_px)
    else:
        files = [source.droplets_path(place) for source in sources]
        require_free(*files, *(export_path(file, kind) for file in files for kind in options.export), overwrite=False)
        result = _measure_all(options, settings, sources, place, origin, by_rig_um_per_px)
    return Outcome(result, f"{_table(result)}\n{place}: {_summary(result)}")


def _measure_all(
    options: Namespace,
    settings: "FlatSettings",
    sources: "list[FlatSource]",
    out: Path,
    origin: "Provenance",
    by_rig_um_per_px: float | None,
) -> dict[str, Any]:
    from processing.analysis.exports.export import export_droplets
    from processing.runs.single_view.measurement import measure_source

    shots = []
    for source in tracked(sources, lambda source: source.name):
        shots.append(measure_source(source, settings, options.um_per_px, out, origin))
        for export in options.export:
            export_droplets(out / shots[-1].file, export)
        for reason in shots[-1].reasons:
            progress(f"{source.name}: {shots[-1].verdict}: {reason}")
    return _result(options, settings, shots, out, by_rig_um_per_px)


def _result(
    options: Namespace, settings: "FlatSettings", shots: "list[FlatShot]", out: Path, by_rig_um_per_px: float | None
) -> dict[str, Any]:
    """What the images say together, of which people are told what casts doubt."""
    from processing.analysis.droplets.droplet_file import read_droplets
    from processing.runs.recipe import recipe_sha256
    from processing.runs.single_view.measurement import (
        COMMAND,
        METHOD_VERSION,
        doubts_together,
        droplets_twice,
        flat_statistics,
        unlike_image_sizes,
    )
    from processing.runs.single_view.stated_scale import scale_doubts
    from processing.runs.unchecked_images import told_unchecked, unchecked_images

    stored = {shot.image or f"shot {shot.shot}": read_droplets(out / shot.file) for shot in shots}
    doubts = (
        *droplets_twice(stored, options.um_per_px),
        *doubts_together(list(stored.values()), options.um_per_px),
        *unlike_image_sizes(stored),
        *scale_doubts(options.um_per_px, by_rig_um_per_px),
    )
    unchecked_um_per_px = options.um_per_px if by_rig_um_per_px is None else None
    unchecked = unchecked_images(settings.polarity, single=True, um_per_px=unchecked_um_per_px)
    for doubt in doubts:
        progress(doubt)
    return {
        "polarity": settings.polarity,
        "um_per_px": options.um_per_px,
        "recipe_sha256": recipe_sha256(COMMAND, METHOD_VERSION, settings),
        "shots": [shot.model_dump(mode="json") for shot in shots],
        "not_checked": told_unchecked(unchecked, progress),
        "statistics": flat_statistics(list(stored.values())),
        "doubts": list(doubts),
        "passed": any(shot.verdict != "refused" for shot in shots),
    }


def _table(result: dict[str, Any]) -> str:
    rows = [
        [
            shot["image"],
            str(shot["droplets"]),
            ", ".join(f"{number} {reason.replace('_', ' ')}" for reason, number in shot["left_out"].items()),
            f"{shot['cpu_s']:.1f}",
            shot["verdict"],
            shot["file"],
        ]
        for shot in result["shots"]
    ]
    return table(["image", "droplets", "left out", "CPU-s", "verdict", "file"], rows)


def _summary(result: dict[str, Any]) -> str:
    unit = "px" if result["um_per_px"] is None else "um"
    statistics = result["statistics"]
    seen = f"{counted(statistics['n'], 'droplet')} in {counted(len(result['shots']), 'image')}"
    d32 = statistics[f"d32_{unit}"]
    if d32 is None:
        return f"{seen}: {statistics['reason']}"
    value, low, high = digits_of_interval(d32["value"], d32["low"], d32["high"])
    return f"{seen}, D32 {value} ({low} to {high}) {unit}{_unmeasured(result)}{_doubted(result)}"


def _doubted(result: dict[str, Any]) -> str:
    return "".join(f"\n{doubt}" for doubt in result["doubts"])


def _unmeasured(result: dict[str, Any]) -> str:
    """What means lack, in a line of its own; nothing where all was measured that is a droplet."""
    left_out: Counter[str] = sum((Counter(shot["left_out"]) for shot in result["shots"]), Counter())
    if not left_out["small"]:
        return ""
    return (
        f"\nmeans are of the larger droplets: {left_out['small']} seen are smaller than least_diameter_px of the "
        "recipe, and not measured"
    )
