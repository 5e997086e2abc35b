"""The command line. ``--json`` prints one JSON object as the last line of stdout; progress goes to stderr.

Exit status: 0 done, 1 failed (also a result that says ``passed: false``), 2 bad usage or bad input.
"""

import argparse
import json
import re
import sys
from collections.abc import Callable, Sequence
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Any

from daq.errors import DaqError, PlanError, ShotFileError
from processing.errors import BadInput
from processing.reconstruction.accuracy import Accuracy
from processing.reconstruction.method import ReconstructionMethod
from processing.reconstruction.settings import ReconstructionSettings
from processing.reconstruction.voxel_type import VoxelType
from server.cli import commands
from server.cli.average_command import average
from server.cli.bench_command import bench
from server.cli.calibrate_command import calibrate_views, stated_origin, stated_roll
from server.cli.check_command import check, self_calibrate_views
from server.cli.doctor_command import doctor
from server.cli.firmware_options import add_firmware_tools
from server.cli.study_options import add_studies

BAD_INPUT = (BadInput, PlanError, ShotFileError)
Command = Callable[[argparse.Namespace], dict[str, Any]]

_NEGATIVE = re.compile(r"-\.?\d")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; the exit status."""
    options = _parser().parse_args(_joined(sys.argv[1:] if arguments is None else arguments))
    command: Command = options.command
    try:
        result = command(options)
    except BAD_INPUT as error:
        return _fail(options, error, status=2)
    except (DaqError, MemoryError, OSError) as error:
        return _fail(options, error, status=1)
    except KeyboardInterrupt:
        return _fail(options, RuntimeError("interrupted"), status=1)
    if options.json or result:
        print(json.dumps(result) if options.json else commands.readable(result))  # noqa: T201
    return 0 if result.get("passed", True) else 1


def _joined(arguments: Sequence[str]) -> list[str]:
    """Options joined by = with values that begin with a minus: argparse takes -5:5,-5:5,0:1 for another option."""
    joined: list[str] = []
    for argument in arguments:
        if joined and re.fullmatch(r"--[^=]+", joined[-1]) and _NEGATIVE.match(argument):
            joined[-1] += f"={argument}"
        else:
            joined.append(argument)
    return joined


def _fail(options: argparse.Namespace, error: BaseException, status: int) -> int:
    print(f"tomoshadow: {error}", file=sys.stderr)  # noqa: T201
    if options.json:
        print(json.dumps({"error": str(error), "kind": type(error).__name__}))  # noqa: T201
    return status


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="tomoshadow", description="Tomographic shadowgraphy, from trigger to volume.")
    verbs = parser.add_subparsers(required=True, metavar="COMMAND")
    _add_demo(verbs)
    _add_serve(verbs)
    _add_doctor(verbs)
    _add_import(verbs)
    _add_calibrate(verbs)
    _add_check(verbs)
    _add_self_calibrate(verbs)
    _add_reconstruct(verbs)
    _add_average(verbs)
    _add_study(verbs)
    _add_optics(verbs)
    _add_bench(verbs)
    _add_firmware(verbs)
    return parser


def _verb(verbs: Any, name: str, command: Command, summary: str) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = verbs.add_parser(name, help=summary, description=summary)
    parser.add_argument("--json", action="store_true", help="print one JSON object as the last line")
    parser.set_defaults(command=command)
    return parser


def _add_demo(verbs: Any) -> None:
    parser = _verb(verbs, "demo", commands.demo, "run the whole chain on the simulated bench")
    parser.add_argument("--out", type=Path, default=Path("demo-out"), help="where runs, results and report.html go")
    parser.add_argument("--shots", type=int, default=8, help="double exposures to record")
    parser.add_argument("--config", type=Path, default=Path("configs/simulated.toml"), help="a simulated rig")
    parser.add_argument("--firmware", choices=("host", "emulated"), help="instead of the configuration's")


def _add_serve(verbs: Any) -> None:
    parser = _verb(verbs, "serve", commands.serve, "start server and web page")
    parser.add_argument("--config", type=Path, required=True, help="rig configuration")
    parser.add_argument("--host", help="address to bind to, default 127.0.0.1")
    parser.add_argument("--port", type=int, help="port to bind to, default 8080")


def _add_doctor(verbs: Any) -> None:
    parser = _verb(verbs, "doctor", doctor, "what is wrong with this computer and the rig, and how to mend it")
    parser.add_argument("--config", type=Path, help="rig configuration; without it only the computer is looked at")


def _add_import(verbs: Any) -> None:
    parser = _verb(verbs, "import", commands.import_images, "images from elsewhere become a run or a calibration set")
    parser.add_argument("manifest", type=Path, metavar="MANIFEST.toml")
    parser.add_argument("-o", "--out", type=Path, required=True, help="directory to create")


def _add_calibrate(verbs: Any) -> None:
    parser = _verb(verbs, "calibrate", calibrate_views, "fit the camera of every view to a calibration set")
    parser.add_argument("set", type=Path, help="calibration run, or an imported set")
    parser.add_argument("-o", "--out", type=Path, required=True, help="calibration file to write")
    parser.add_argument(
        "--model",
        choices=("pinhole", "pinhole_tilted", "polynomial", "auto"),
        default="pinhole",
        help="auto: for each view the simplest one, unless another predicts unseen points clearly better",
    )
    parser.add_argument(
        "--origin",
        type=stated_origin,
        action="append",
        metavar="VIEW@Z=U,V",
        help="where a view of a run sees the target's origin at position Z in mm, if no image shows all of it",
    )
    parser.add_argument(
        "--roll",
        type=stated_roll,
        action="append",
        metavar="VIEW=DEG",
        help="how a camera of a run is turned about its axis: 180 if it hangs upside down",
    )


def _add_check(verbs: Any) -> None:
    parser = _verb(verbs, "check", check, "do the droplets in the shots of a run still agree with a calibration?")
    _add_droplet_options(parser)


def _add_self_calibrate(verbs: Any) -> None:
    parser = _verb(verbs, "self-calibrate", self_calibrate_views, "correct a calibration by the droplets in shots")
    _add_droplet_options(parser)
    parser.add_argument("-o", "--out", type=Path, required=True, help="calibration file to write")


def _add_droplet_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("run", type=Path, help="run directory")
    parser.add_argument("--calibration", type=Path, required=True)
    parser.add_argument("--shots", metavar="A:B", help="shots A to B - 1; default all")


def _add_reconstruct(verbs: Any) -> None:
    parser = _verb(verbs, "reconstruct", commands.reconstruct_run, "turn the shots of a run into volumes")
    parser.add_argument("run", type=Path, help="run directory")
    parser.add_argument("--calibration", type=Path, required=True)
    parser.add_argument("-o", "--out", type=Path, required=True, help="directory of the results")
    _add_reconstruction_options(parser)
    _add_choice(parser, "voxels", VoxelType)


def _add_reconstruction_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--method", choices=[method.value for method in ReconstructionMethod], default="mlos")
    _add_choice(parser, "accuracy", Accuracy)
    for name in ("iterations", "relaxation", "least_gain"):
        field = ReconstructionSettings.model_fields[name]
        parser.add_argument(
            f"--{name.replace('_', '-')}",
            type=partial(commands.setting, name),
            default=field.default,
            metavar="N" if isinstance(field.default, int) else "X",
            help=field.description,
        )
    parser.add_argument("--shots", metavar="A:B", help="shots A to B - 1; default all")
    parser.add_argument(
        "--grid",
        metavar="X0:X1,Y0:Y1,Z0:Z1[@PITCH]",
        help="box in mm, voxel edge in mm; default: what all views see within the calibrated z range, one pixel",
    )


def _add_choice(parser: argparse.ArgumentParser, name: str, kind: type[StrEnum]) -> None:
    field = ReconstructionSettings.model_fields[name]
    parser.add_argument(
        f"--{name}", choices=[one.value for one in kind], default=field.default.value, help=field.description
    )


def _add_average(verbs: Any) -> None:
    parser = _verb(verbs, "average", average, "mean volume and slices of results, or straight from the shots of a run")
    parser.add_argument("results", type=Path, help="directory of results; or a run, with --calibration")
    parser.add_argument("-o", "--out", type=Path, required=True, help="volume file to write; slices beside it")
    parser.add_argument("--calibration", type=Path, help="of the run; no volume of a single exposure is stored")
    _add_reconstruction_options(parser)
    parser.set_defaults(voxels=VoxelType.FLOAT32.value)  # a mean has finer steps than one exposure


def _add_study(verbs: Any) -> None:
    studies = verbs.add_parser("study", help="the paper's simulations").add_subparsers(required=True, metavar="STUDY")
    add_studies(partial(_verb, studies))


def _add_optics(verbs: Any) -> None:
    parser = _verb(verbs, "optics", commands.optics, "optics of a rig: d_A, depth of field, blur, straddling window")
    parser.add_argument("--config", type=Path, required=True, help="rig configuration")


def _add_bench(verbs: Any) -> None:
    parser = _verb(verbs, "bench", bench, "speed of kernels and recorder against plain numpy and OpenCV")
    parser.add_argument("--quick", action="store_true", help="a small volume; the figures mean little")
    parser.add_argument("--directory", type=Path, help="where the recorder writes; default: the temporary directory")
    parser.add_argument("--table", type=Path, help="Markdown file whose table, between <!-- bench --> marks, to renew")


def _add_firmware(verbs: Any) -> None:
    tools = verbs.add_parser("firmware", help="the pulse generator").add_subparsers(required=True, metavar="TOOL")
    add_firmware_tools(partial(_verb, tools))
