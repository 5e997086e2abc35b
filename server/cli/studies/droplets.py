"""``tomoshadow study droplets``: droplets found and ghosts, where the truth is known."""

from argparse import Namespace
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from server.cli.options import Verbs, positive, seed, usable_processors, view_count, width
from server.cli.studies.study_command import add_repeats, add_study, collected, passing, report, seeds_of

if TYPE_CHECKING:
    from processing.studies.droplets import DropletCase

VARIED = {
    "density": "density_per_mm3",
    "sigma": "sigma_px",
    "noise": "noise_percent",
    "views": "views",
    "calibration_error": "calibration_error_px",
}
"""Options, and what they change of a case."""


def add_droplets(studies: Verbs) -> None:
    """Add the study; without options that vary a case, it tries all cases for which something is asked for."""
    parser = add_study(studies, "droplets", droplets, "droplets found and ghosts when images are explained by droplets")
    add_repeats(parser, "shot", 5)
    parser.add_argument("--density", type=positive, help="droplets per mm^3")
    parser.add_argument("--sigma", type=width, help="width of droplets in px")
    parser.add_argument("--noise", type=positive, metavar="PERCENT", help="of the median amplitude")
    parser.add_argument("--views", type=view_count, help="2 to 8, over the paper's angles")
    parser.add_argument("--calibration-error", type=positive, metavar="PX", help="of every view")
    parser.add_argument("--twins", type=seed, default=0, help="simulated twins per shot that tell ghosts")


def droplets(options: Namespace) -> dict[str, Any]:
    """Run the study."""
    from processing.studies.droplets import (
        DropletStudy,
        all_reached,
        droplet_figure,
        droplet_line,
        droplet_statements,
        droplet_study,
    )

    study = DropletStudy(seeds=seeds_of(options), twins=options.twins)
    case = _stated_case(options)
    if case:
        study = replace(study, cases=(case,))
    rows = collected(droplet_study(study, usable_processors()), droplet_line)
    result = report(options.out, "droplets", rows, droplet_figure(rows), droplet_statements(rows))
    return passing(result, all_reached(rows), "every mean reaches what is asked for")


def _stated_case(options: Namespace) -> "DropletCase | None":
    """The case of the options; with what is asked for, where it is one of those."""
    from processing.studies.droplets import ASKED_FOR, DropletCase
    from processing.studies.report import asked_case

    stated = {field: value for name, field in VARIED.items() if (value := getattr(options, name)) is not None}
    if not stated:
        return None
    return asked_case(DropletCase(**stated), ASKED_FOR)
