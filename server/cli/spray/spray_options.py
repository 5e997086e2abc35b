"""What the commands on sprays are told: results, nozzle and axis, distances, and the liquid's density."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from server.cli.options import number, positive

if TYPE_CHECKING:
    from processing.analysis.spray.spray_statistics import AskedFor
    from processing.runs.sprays.measured_spray import MeasuredSpray

Triple = tuple[float, float, float]


def add_sprays(parser: ArgumentParser) -> None:
    """Let a command be told the results of measurements, and what is known of the spray."""
    parser.add_argument(
        "results",
        type=Path,
        nargs="+",
        help="directories that measure wrote, or runs that the server measured; their shots are pooled",
    )
    parser.add_argument(
        "--nozzle", type=_triple, metavar="X,Y,Z", help="middle of the orifice in mm; default: as the run says"
    )
    parser.add_argument("--axis", type=_triple, metavar="X,Y,Z", help="direction of the spray; default 0,1,0: down")
    parser.add_argument(
        "--at",
        type=positive,
        action="append",
        metavar="MM",
        help="distance from the nozzle of a patternation; may be repeated; default: the middle of the box",
    )
    parser.add_argument("--liquid-density", type=positive, metavar="KG_M3", help="makes mass of volume flux")


def _triple(text: str) -> Triple:
    parts = text.split(",")
    if len(parts) != 3:
        raise ArgumentTypeError(f"{text}: three numbers are asked for, X,Y,Z")
    x, y, z = map(number, parts)
    return x, y, z


def asked_for(options: Namespace, spray: "MeasuredSpray") -> "AskedFor":
    """What the options say of a spray, and where they do not, its run.

    Raises
    ------
    DropletFileError
        An axis without a nozzle, or one that is no direction; or a density that no liquid has.
    """
    from processing.analysis.droplets.droplet_file import DropletFileError
    from processing.analysis.spray.spray_axis import SprayAxis
    from processing.analysis.spray.spray_statistics import AskedFor

    axis = spray.axis
    if options.nozzle is None and options.axis is not None and axis is None:
        raise DropletFileError("--axis: where the nozzle is, neither the run nor --nozzle X,Y,Z says")
    if options.nozzle or options.axis:
        nozzle_mm = options.nozzle or (axis.nozzle_mm if axis else (0.0, 0.0, 0.0))
        direction = options.axis or (axis.direction if axis else (0.0, 1.0, 0.0))
        try:
            axis = SprayAxis(nozzle_mm, direction)
        except ValueError as error:
            raise DropletFileError(f"--nozzle, --axis: {error}") from error
    try:
        return AskedFor(axis, tuple(options.at or ()), options.liquid_density)
    except ValueError as error:
        raise DropletFileError(f"--liquid-density: {error}") from error
