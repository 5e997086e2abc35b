"""``tomoshadow study statistics``: how often the intervals of a spray's figures hold the truth."""

from argparse import Namespace
from typing import Any

from server.cli.options import Verbs, count, seed
from server.cli.studies.study_command import add_study, collected, passing, report


def add_statistics(studies: Verbs) -> None:
    """Add the study."""
    parser = add_study(
        studies, "statistics", statistics, "how often intervals of D32, Dv0.5, span, flux hold the truth"
    )
    parser.add_argument("--sprays", type=count, default=200, help="of each case")
    parser.add_argument("--seed", type=seed, default=501, help="of all sprays")


def statistics(options: Namespace) -> dict[str, Any]:
    """Run the study."""
    from processing.studies.sprays.statistics import (
        StatisticsStudy,
        all_held,
        statistics_figure,
        statistics_line,
        statistics_statements,
        statistics_study,
    )

    study = StatisticsStudy(sprays=options.sprays, seed=options.seed)
    rows = collected(statistics_study(study), statistics_line)
    result = report(options.out, "statistics", rows, statistics_figure(rows), statistics_statements(rows))
    return passing(result, all_held(rows), "every interval asked for holds the truth in 85 to 95 %")
