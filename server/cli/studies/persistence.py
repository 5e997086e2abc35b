"""``tomoshadow study persistence``: how many ghosts droplets without a partner tell, against how many there are."""

from argparse import Namespace
from typing import Any

from server.cli.options import Verbs, usable_processors
from server.cli.studies.study_command import add_repeats, add_study, collected, passing, report, seeds_of


def add_persistence(studies: Verbs) -> None:
    """Add the study."""
    parser = add_study(studies, "persistence", persistence, "how many ghosts droplets without a partner in B tell")
    add_repeats(parser, "double exposure", 3)


def persistence(options: Namespace) -> dict[str, Any]:
    """Run the study."""
    from processing.studies.real_droplets.case_shares import all_close
    from processing.studies.real_droplets.persistence import (
        persistence_figure,
        persistence_line,
        persistence_shares,
        persistence_statements,
        persistence_study,
    )
    from processing.studies.real_droplets.reality import RealityStudy

    study = RealityStudy(seeds=seeds_of(options))
    rows = collected(persistence_study(study, usable_processors()), persistence_line)
    result = report(options.out, "persistence", rows, persistence_figure(rows), persistence_statements(rows))
    return passing(result, all_close(persistence_shares(rows)), "as many are ghosts as droplets without a partner tell")
