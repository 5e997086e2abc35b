"""``tomoshadow import``: images from elsewhere."""

from argparse import Namespace
from pathlib import Path
from typing import Any

from server.cli.options import Verbs, add_verb
from server.cli.output import Outcome


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, "import", import_images, "images from elsewhere become a run or a calibration set")
    parser.add_argument("manifest", type=Path, metavar="MANIFEST.toml")
    parser.add_argument("-o", "--out", type=Path, required=True, help="directory to create")


def import_images(options: Namespace) -> Outcome:
    """Import all that a manifest names."""
    from processing.runs.importing import import_manifest

    result = {"out": str(options.out), **import_manifest(options.manifest, options.out)}
    return Outcome(result, imported(result))


def imported(result: dict[str, Any]) -> str:
    """What was written, for people."""
    lines = [f"cameras: {', '.join(result['cameras'])}"]
    if result["calibration"]:
        lines.append(f"calibration set: {result['calibration']}, {result['planes']} planes")
    if result["run"]:
        lines.append(f"run: {result['run']}, {result['shots']} shots")
    return "\n".join(lines)
