"""``tomoshadow tracks``: the measured droplets of a series of shots become tracks."""

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from daq.counted import counted
from processing.analysis.velocity import HALF_WINDOW
from server.cli.options import Verbs, add_out, add_verb, count, positive
from server.cli.output import Outcome, progress
from server.cli.runs.export_option import add_export

if TYPE_CHECKING:
    from processing.analysis.droplets.droplet_file import StoredDroplets
    from processing.analysis.velocity.track_table import DropletTracks

KEPT = ("run", "run_created_utc", "calibration", "calibration_sha256", "grid", "recipe_sha256", "tomoshadow")
"""Of what the files of droplets say of themselves."""


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, "tracks", tracks, "link the droplets of a series of shots to tracks")
    parser.add_argument("results", type=Path, help="directory of what measure wrote of one run")
    add_out(parser, "file of the tracks, *.h5")
    parser.add_argument(
        "--rate-hz", type=positive, metavar="HZ", help="of the shots, at even times; default: as the run states it"
    )
    parser.add_argument(
        "--half-window",
        type=count,
        default=HALF_WINDOW,
        metavar="N",
        help=f"shots before and after with a say in motion, default {HALF_WINDOW}",
    )
    add_export(parser, "tracks")


def tracks(options: Namespace) -> Outcome:
    """Read, link, write."""
    from processing.analysis.droplets.droplet_file import DropletFileError
    from processing.analysis.exports.export import export_path, export_tracks
    from processing.analysis.velocity.track_file import write_tracks
    from processing.analysis.velocity.track_table import track_droplets
    from processing.runs.droplets_in_place import read_in_place
    from processing.runs.overwriting import require_free
    from processing.runs.sprays.measured_spray import measured_in

    for export in options.export:
        export.require()
    exports = [export_path(options.out, export) for export in options.export]
    require_free(options.out, *exports, overwrite=options.overwrite)
    files = sorted(measured_in(options.results).glob("shot_*_droplets.h5"))
    if not files:
        raise DropletFileError(f"{options.results}: has no droplets of shots; measure them first (tomoshadow measure)")
    shots = [read_in_place(file) for file in files]
    linked = track_droplets(shots, options.rate_hz, options.half_window)
    write_tracks(
        options.out, linked, {name: one for name in KEPT if (one := shots[0].provenance.get(name)) is not None}
    )
    for export in options.export:
        export_tracks(options.out, export)
    result = _told(linked, shots, options.out)
    return Outcome(result, _summary(result))


def _told(linked: "DropletTracks", shots: "list[StoredDroplets]", file: Path) -> dict[str, Any]:
    from processing.analysis.even_rows import row_spacing_mm
    from processing.runs.unchecked_images import even_rows, off_tracks, stated_rate, told_unchecked

    told = (*even_rows(row_spacing_mm(shots)), *off_tracks(linked.share_alone))
    unchecked = [stated_rate(linked.rate_hz), *told] if linked.tracks else []
    return {
        "tracks": linked.tracks,
        "shots": len(shots),
        "droplets": linked.droplets,
        "share_tracked": linked.share_tracked,
        "median_length": linked.median_length,
        "rate_hz": linked.rate_hz,
        "half_window": linked.half_window,
        "noise_curve": linked.noise_curve.plain() if linked.noise_curve else None,
        "reason": linked.reason,
        "doubts": list(linked.doubts),
        "not_checked": told_unchecked(unchecked, progress),
        "file": str(file),
        "passed": linked.tracks > 0,
    }


def _summary(result: dict[str, Any]) -> str:
    seen = f"{counted(result['droplets'], 'droplet')} of {counted(result['shots'], 'shot')}"
    if result["reason"]:
        return "\n".join([f"{seen}: {result['reason']}", *result["doubts"]])
    tracked = f"{100 * result['share_tracked']:.1f} % of {seen}"
    tracks = f"{counted(result['tracks'], 'track')} with {tracked}"
    told = f"{tracks}, {result['median_length']:g} in a median one; {result['file']}"
    return "\n".join([told, *_proposed(result), *result["doubts"]])


def _proposed(result: dict[str, Any]) -> list[str]:
    if not (curve := result["noise_curve"]):
        return []
    least = f"{curve['for_velocity']} for velocities, {curve['for_acceleration']} for accelerations"
    return [f"half window of least error: {least}; {result['half_window']} was taken (--half-window)"]
