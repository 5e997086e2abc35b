"""``tomoshadow study velocity``: droplets of double exposures, paired where the truth is known."""

from argparse import Namespace
from dataclasses import replace
from typing import Any

from server.cli.options import Verbs, count, positive, seed, usable_processors
from server.cli.studies.study_command import add_study, collected, passing, report


def add_velocity(studies: Verbs) -> None:
    """Add the study; without a density it tries all cases for which something is asked for."""
    parser = add_study(studies, "velocity", velocity, "droplets of double exposures: how many paired, how rightly")
    parser.add_argument("--seed", type=seed, default=301, help="of the first double exposure of a case")
    parser.add_argument("--repeats", type=count, default=5, help="double exposures of a case")
    parser.add_argument("--droplets", choices=("bright", "opaque"), help="bright particles, or droplets in shadows")
    parser.add_argument("--density", type=positive, help="droplets per mm^3")


def velocity(options: Namespace) -> dict[str, Any]:
    """Run the study."""
    from processing.studies.report import asked_case
    from processing.studies.velocity.velocities import (
        ASKED_FOR,
        VelocityCase,
        VelocityStudy,
        all_reached,
        velocity_figure,
        velocity_line,
        velocity_statements,
        velocity_study,
    )

    study = VelocityStudy(seeds=tuple(range(options.seed, options.seed + options.repeats)))
    stated = {"droplets": options.droplets, "density_per_mm3": options.density}
    if stated := {name: value for name, value in stated.items() if value is not None}:
        case = VelocityCase(**stated)
        study = replace(study, cases=(asked_case(case, ASKED_FOR),))
    rows = collected(velocity_study(study, usable_processors()), velocity_line)
    figure, statements = velocity_figure(rows, study.cases), velocity_statements(rows, study.cases)
    result = report(options.out, "velocity", rows, figure, statements)
    return passing(result, all_reached(rows, study.cases), "every case reaches what is asked for")
