"""``tomoshadow import``: images from elsewhere."""

from argparse import Namespace
from pathlib import Path
from typing import Any

from daq.counted import counted
from server.cli.options import Verbs, add_out, add_verb
from server.cli.output import Bar, Outcome, progress


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, "import", import_images, "images from elsewhere become a run or a calibration set")
    parser.add_argument("manifest", type=Path, metavar="MANIFEST.toml")
    add_out(parser, "directory to create; calibrate, reconstruct, check and average take it as it is")


def import_images(options: Namespace) -> Outcome:
    """Import all that a manifest names."""
    from processing.runs.manifest.importing import import_manifest

    try:
        with Bar() as bar:
            parts = import_manifest(options.manifest, options.out, overwrite=options.overwrite, done=bar.step)
    except KeyboardInterrupt:
        progress(f"{options.out}: all or nothing, so nothing was written; to go on, import again")
        raise
    for note in parts["notes"]:
        progress(note)
    result = {"out": str(options.out), **parts}
    return Outcome(result, imported(result))


def imported(result: dict[str, Any]) -> str:
    """What was written, for people."""
    lines = [f"cameras: {', '.join(result['cameras'])}"]
    if result["calibration"]:
        lines.append(f"calibration set: {result['calibration']}, {counted(result['planes'], 'plane')}")
    if result["run"]:
        lines.append(f"run: {result['run']}, {counted(result['shots'], 'shot')}")
    return "\n".join(lines)
