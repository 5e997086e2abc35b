"""``tomoshadow study reality``: how probably droplets are told to be real, against how many are."""

from argparse import Namespace
from typing import Any

from server.cli.options import Verbs, usable_processors
from server.cli.studies.study_command import add_repeats, add_study, collected, passing, report, seeds_of


def add_reality(studies: Verbs) -> None:
    """Add the study."""
    parser = add_study(studies, "reality", reality, "how probably droplets are told to be real, and how many are")
    add_repeats(parser, "shot", 3)


def reality(options: Namespace) -> dict[str, Any]:
    """Run the study."""
    from processing.studies.real_droplets.case_shares import all_close
    from processing.studies.real_droplets.reality import (
        RealityStudy,
        all_true,
        case_shares,
        reality_line,
        reality_of_rows,
        reality_statements,
        reality_study,
    )

    study = RealityStudy(seeds=seeds_of(options))
    rows = collected(reality_study(study, usable_processors()), reality_line)
    result = report(options.out, "reality", rows, reality_of_rows(rows), reality_statements(rows))
    passed = all_true(rows) and all_close(case_shares(rows))
    return passing(result, passed, "as many are real, and as many ghosts, as is told")
