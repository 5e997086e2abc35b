"""``tomoshadow study tracks``: droplets of series of shots, linked where the truth is known."""

from argparse import Namespace
from typing import Any

from server.cli.options import Verbs, usable_processors
from server.cli.studies.study_command import add_linked, collected, linked_cases, passing, report, seeds_of


def add_tracks(studies: Verbs) -> None:
    """Add the study."""
    add_linked(
        studies, "tracks", tracks, "droplets of series of shots: how many whole tracks, how right", "series", 501
    )


def tracks(options: Namespace) -> dict[str, Any]:
    """Run the study."""
    from processing.studies.velocity import tracks as study

    cases = linked_cases(options, study.TrackCase, study.ASKED_FOR)
    asked = study.TrackStudy(cases, seeds_of(options))
    rows = collected(study.track_study(asked, usable_processors()), study.track_line)
    figure, statements = study.track_figure(rows, cases), study.track_statements(rows, cases)
    result = report(options.out, "tracks", rows, figure, statements)
    return passing(result, study.all_reached(rows, cases), "every case reaches what is asked for")
