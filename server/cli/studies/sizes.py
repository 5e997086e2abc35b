"""``tomoshadow study sizes``: droplets and their sizes in shadow images, where the truth is known."""

from argparse import ArgumentTypeError, Namespace
from dataclasses import replace
from typing import Any

from server.cli.options import Verbs, positive, seed, usable_processors, view_count
from server.cli.studies.study_command import add_repeats, add_study, collected, passing, report, seeds_of

VARIED = {
    "density": "density_per_mm3",
    "median": "median_um",
    "noise": "noise_percent",
    "views": "views",
    "calibration_error": "calibration_error_px",
    "condenser_ratio": "condenser_ratio",
    "aperture_ratio": "aperture_ratio",
}
"""Options, and what they change of a case."""


def add_sizes(studies: Verbs) -> None:
    """Add the study; without options that vary a case, it tries all cases for which something is asked for."""
    parser = add_study(studies, "sizes", sizes, "droplets found, ghosts and sizes in shadow images")
    add_repeats(parser, "shot", 5)
    parser.add_argument("--density", type=positive, help="droplets per mm^3")
    parser.add_argument("--median", type=positive, metavar="UM", help="of the diameters")
    parser.add_argument("--noise", type=positive, metavar="PERCENT", help="of the background")
    parser.add_argument("--views", type=view_count, help="2 to 8, over the paper's angles")
    parser.add_argument("--calibration-error", type=positive, metavar="PX", help="of every view")
    parser.add_argument("--condenser-ratio", type=_ratio, metavar="RATIO", help="aperture of the light over the lens's")
    blurred = "so many times the blur of the paper's lenses, by a smaller aperture"
    parser.add_argument("--blur", type=_aperture, dest="aperture_ratio", metavar="FACTOR", help=blurred)
    parser.add_argument("--twins", type=seed, default=0, help="simulated twins per shot that tell ghosts")


def _aperture(text: str) -> float:
    """That of the lenses over the paper's, for so many times the blur."""
    return 1 / positive(text)


def _ratio(text: str) -> float:
    """A light that can be simulated."""
    from processing.coherent_light import MOST_RATIO

    if (ratio := positive(text)) > MOST_RATIO:
        raise ArgumentTypeError(f"{text} must be at most {MOST_RATIO:g}, which is light from all directions")
    return ratio


def sizes(options: Namespace) -> dict[str, Any]:
    """Run the study."""
    from processing.studies.report import asked_case
    from processing.studies.shadows.sizes import (
        ASKED_FOR,
        SizeCase,
        SizeStudy,
        all_reached,
        size_figure,
        size_line,
        size_statements,
        size_study,
    )

    study = SizeStudy(seeds=seeds_of(options), twins=options.twins)
    stated = {field: value for name, field in VARIED.items() if (value := getattr(options, name)) is not None}
    if stated:
        case = SizeCase(**stated)
        study = replace(study, cases=(asked_case(case, ASKED_FOR),))
    rows = collected(size_study(study, usable_processors()), size_line)
    figure, statements = size_figure(rows, study.cases), size_statements(rows, study.cases)
    result = report(options.out, "sizes", rows, figure, statements)
    return passing(result, all_reached(rows, study.cases), "every case reaches what is asked for")
