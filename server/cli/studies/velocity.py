"""``tomoshadow study velocity``: droplets of double exposures, paired where the truth is known."""

from argparse import Namespace
from typing import Any

from server.cli.options import Verbs, usable_processors
from server.cli.studies.study_command import add_linked, collected, linked_cases, passing, report, seeds_of


def add_velocity(studies: Verbs) -> None:
    """Add the study."""
    add_linked(
        studies,
        "velocity",
        velocity,
        "droplets of double exposures: how many paired, how rightly",
        "double exposure",
        301,
    )


def velocity(options: Namespace) -> dict[str, Any]:
    """Run the study."""
    from processing.studies.velocity import velocities as study

    cases = linked_cases(options, study.VelocityCase, study.ASKED_FOR)
    asked = study.VelocityStudy(cases, seeds_of(options))
    rows = collected(study.velocity_study(asked, usable_processors()), study.velocity_line)
    figure, statements = study.velocity_figure(rows, cases), study.velocity_statements(rows, cases)
    result = report(options.out, "velocity", rows, figure, statements)
    return passing(result, study.all_reached(rows, cases), "every case reaches what is asked for")
