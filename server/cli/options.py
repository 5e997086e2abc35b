"""What several commands are told: rig, run, calibration, shots, grid and method; and what they make of it."""

import math
import os
import re
from argparse import ArgumentParser, ArgumentTypeError, Namespace, _SubParsersAction
from collections.abc import Callable
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from processing.reconstruction.choices import Accuracy, ReconstructionMethod
from processing.runs.errors import PipelineError
from server.cli.output import Outcome, progress

if TYPE_CHECKING:
    from collections.abc import Sequence

    from processing.calibration.calibration import Calibration
    from processing.reconstruction.settings import FrozenValue, ReconstructionSettings
    from processing.volume import VoxelGrid

Verbs: TypeAlias = "_SubParsersAction[ArgumentParser]"
Command = Callable[[Namespace], Outcome]

OPTIONS = (
    "method",
    "accuracy",
    "voxels",
    "iterations",
    "relaxation",
    "least_gain",
    "minimum_window_px",
    "noise_floor",
)
"""Settings that have an option of their name."""

MIN_SIGMA_VOXEL, MAX_SIGMA_VOXEL = 0.3, 10.0

MOST_BEYOND = 0.5
"""Of what is calibrated along an axis: farther beyond it a grid is asked about."""
LEAST_SHARE = 1e-6
"""Of the calibrated volume: a grid that holds less is in another unit, or elsewhere."""


def add_verb(verbs: Verbs, name: str, command: Command, summary: str) -> ArgumentParser:
    """Add a command."""
    parser = verbs.add_parser(name, help=summary, description=summary)
    parser.add_argument("--json", action="store_true", help="print one JSON object as the last line")
    parser.set_defaults(command=command)
    return parser


def add_rig(parser: ArgumentParser) -> None:
    """Let a command be told the rig."""
    parser.add_argument("--config", type=Path, required=True, help="rig configuration")


def add_calibrated_run(parser: ArgumentParser) -> None:
    """Let a command be told a run, and the calibration of its views."""
    parser.add_argument("run", type=run_directory, help="run directory, or that of an import which has a run")
    parser.add_argument("--calibration", type=Path, required=True)


def run_directory(text: str) -> Path:
    """The run in the directory of an import, or the directory that is named."""
    path, imported = Path(text), Path(text) / "run"
    return imported if not (path / "run.h5").exists() and (imported / "run.h5").exists() else path


def add_out(parser: ArgumentParser, summary: str, default: Path | None = None) -> None:
    """Let a command be told where to write, and whether what is there may be replaced."""
    parser.add_argument("-o", "--out", type=Path, required=default is None, default=default, help=summary)
    _add_overwrite(parser)


def _add_overwrite(parser: ArgumentParser) -> None:
    """Let a command replace what exists."""
    parser.add_argument("--overwrite", action="store_true", help="replace what is there, once all is computed")


def add_shots(parser: ArgumentParser) -> None:
    """Let a command be told which shots to take."""
    parser.add_argument("--shots", metavar="A:B", help="shots A to B - 1; default all")


def add_reconstruction(parser: ArgumentParser) -> None:
    """Let a command be told how to reconstruct which shots; what is not said is left to ReconstructionSettings."""
    parser.add_argument("--method", choices=[method.value for method in ReconstructionMethod])
    add_choice(parser, "accuracy", Accuracy, "fine: two to three times more accurate, at twice the cost")
    _add_limited(parser, "iterations", "N", "of SMART and MART, at most")
    _add_limited(parser, "relaxation", "X", "exponent of SMART and MART; the paper's is 1")
    summary = "SMART and MART stop when an iteration lowers the residual by less than this share"
    _add_limited(parser, "least_gain", "X", summary)
    _add_limited(parser, "minimum_window_px", "PX", "sliding minimum, wider than a droplet; 0 leaves it out")
    _add_limited(parser, "noise_floor", "X", "intensity that counts as nothing")
    add_shots(parser)
    parser.add_argument(
        "--grid",
        metavar="X0:X1,Y0:Y1,Z0:Z1[@PITCH]",
        help="box in mm, voxel edge in mm; default: the largest that all views see where they are calibrated",
    )


def add_choice(parser: ArgumentParser, name: str, kind: type[StrEnum], summary: str) -> None:
    """Let a command be told one of a kind."""
    parser.add_argument(f"--{name}", choices=[one.value for one in kind], help=summary)


def _add_limited(parser: ArgumentParser, name: str, metavar: str, summary: str) -> None:
    option = f"--{name.replace('_', '-')}"
    parser.add_argument(option, type=partial(setting, name), metavar=metavar, help=summary)


def number(text: str) -> float:
    """A number as spreadsheets write it."""
    try:
        if "_" in text or not text.isascii():  # Python takes 1_0 for ten
            raise ValueError(text)
        return float(text)
    except ValueError as error:
        raise ArgumentTypeError(f"{text!r} is no number: a point stands before decimals, and no commas") from error


def whole(text: str) -> int:
    """A whole number in digits."""
    if not re.fullmatch(r"[-+]?\d+", text, re.ASCII):
        raise ArgumentTypeError(f"{text!r} is no whole number")
    return int(text)


def positive(text: str) -> float:
    """A finite number above 0."""
    if not 0 < (value := number(text)) < math.inf:
        raise ArgumentTypeError(f"{text} must be above 0, and finite")
    return value


def width(text: str) -> float:
    """Width of a droplet in voxel: one that a voxel can show, and that a window of the quality factor holds."""
    if not MIN_SIGMA_VOXEL <= (value := number(text)) <= MAX_SIGMA_VOXEL:
        raise ArgumentTypeError(f"{text} must be from {MIN_SIGMA_VOXEL:g} to {MAX_SIGMA_VOXEL:g} voxel")
    return value


def seed(text: str) -> int:
    """A whole number from 0 on."""
    if (value := whole(text)) < 0:
        raise ArgumentTypeError(f"{text} must be 0 or more")
    return value


def count(text: str) -> int:
    """A whole number from 1 on."""
    if not (value := whole(text)) > 0:
        raise ArgumentTypeError(f"{text} must be 1 or more")
    return value


def view_count(text: str) -> int:
    """So many views as droplets are measured by."""
    if not 2 <= (value := whole(text)) <= 8:
        raise ArgumentTypeError(f"{text}: 2 to 8 views are measured")
    return value


def setting(name: str, text: str, kind: "type[FrozenValue] | None" = None) -> Any:
    """The value of an option, with the limits of the setting of that name; by default of a reconstruction."""
    from pydantic import ValidationError

    from processing.reconstruction.settings import ReconstructionSettings

    if "_" in text:
        raise ArgumentTypeError(f"{text!r} is no number")
    try:
        return getattr((kind or ReconstructionSettings).model_validate({name: text}), name)
    except ValidationError as error:
        raise ArgumentTypeError(f"{text}: {error.errors()[0]['msg']}") from error


def reconstruction_settings(options: Namespace, calibration: "Calibration") -> "ReconstructionSettings":
    """Grid, method and options of a command as settings."""
    from processing.reconstruction.planning.calibrated_plan import default_grid
    from processing.reconstruction.settings import GridSettings, ReconstructionSettings
    from processing.runs.stated_grid import parse_grid

    grid = parse_grid(options.grid, calibration) if options.grid else default_grid(calibration)
    said = {name: value for name in OPTIONS if (value := getattr(options, name)) is not None}
    return ReconstructionSettings.model_validate({**said, "grid": GridSettings.of(grid)})


def calibrated_share(options: Namespace, settings: "ReconstructionSettings", calibration: "Calibration") -> float:
    """Which part of the calibrated volume the grid holds; of a grid that nobody stated, the user is told."""
    from processing.reconstruction.planning.calibrated_plan import default_grid, told_coarse
    from processing.reconstruction.planning.common_volume import share_within

    grid = settings.grid.to_grid() if settings.grid else default_grid(calibration)
    if coarse := told_coarse(calibration, grid):
        progress(coarse)
    ranges_mm = (calibration.x_range_mm, calibration.y_range_mm, calibration.z_range_mm)
    share = share_within(grid, *ranges_mm)
    if not options.grid and not getattr(options, "recipe", None):
        extents = ", ".join(
            f"{axis} {low:.4g} to {high:.4g}" for axis, (low, high) in zip("xyz", ranges_mm, strict=True)
        )
        progress(
            f"the largest box that all views see holds {100 * share:.0f} % of the calibrated volume "
            f"({extents} mm); --grid takes another box"
        )
    elif share < LEAST_SHARE:
        progress(f"the grid holds {share:.1g} of the calibrated volume: is it in mm, and where the target was?")
    _tell_beyond(grid, ranges_mm)
    return share


def _tell_beyond(grid: "VoxelGrid", ranges_mm: "Sequence[tuple[float, float]]") -> None:
    """Where the grid reaches beyond the target."""
    for axis, (low, high), along_mm in zip("xyz", ranges_mm, (grid.x_mm, grid.y_mm, grid.z_mm), strict=True):
        beyond_mm = max(low - along_mm[0], along_mm[-1] - high)
        if beyond_mm > MOST_BEYOND * (high - low):
            progress(
                f"the grid reaches {beyond_mm:.3g} mm beyond the {axis} of the target, {low:.4g} to {high:.4g} mm: "
                "nobody has checked the calibration there"
            )


def usable_processors() -> int:
    """Processors that this process may use: as many threads as a command takes, which has the machine to itself."""
    return len(os.sched_getaffinity(0))


def picture_beside(file: Path) -> Path:
    """Where the picture of a result goes.

    Raises
    ------
    PipelineError
        The result itself is called so; the picture would take its place.
    """
    picture = file.with_suffix(".png")
    if picture == file:
        raise PipelineError(f"{file}: its picture would take its place; choose another ending")
    return picture


def describe_grid(shape: tuple[int, int, int], pitch_mm: float) -> str:
    """A grid for people, x first as in --grid."""
    nz, ny, nx = shape
    return f"{nx} x {ny} x {nz} voxels of {pitch_mm:.3g} mm"
