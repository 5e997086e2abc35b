"""``tomoshadow study tracks``: droplets of series of shots, linked where the truth is known."""

from argparse import Namespace
from dataclasses import replace
from typing import Any

from server.cli.options import Verbs, count, positive, seed, usable_processors
from server.cli.studies.study_command import add_study, collected, passing, report


def add_tracks(studies: Verbs) -> None:
    """Add the study; without a density it tries all cases for which something is asked for."""
    parser = add_study(studies, "tracks", tracks, "droplets of series of shots: how many whole tracks, how right")
    parser.add_argument("--seed", type=seed, default=501, help="of the first series of a case")
    parser.add_argument("--repeats", type=count, default=5, help="series of a case")
    parser.add_argument("--droplets", choices=("bright", "opaque"), help="bright particles, or droplets in shadows")
    parser.add_argument("--density", type=positive, help="droplets per mm^3")


def tracks(options: Namespace) -> dict[str, Any]:
    """Run the study."""
    from processing.studies.report import asked_case
    from processing.studies.velocity.tracks import (
        ASKED_FOR,
        TrackCase,
        TrackStudy,
        all_reached,
        track_figure,
        track_line,
        track_statements,
        track_study,
    )

    study = TrackStudy(seeds=tuple(range(options.seed, options.seed + options.repeats)))
    stated = {"droplets": options.droplets, "density_per_mm3": options.density}
    if stated := {name: value for name, value in stated.items() if value is not None}:
        case = TrackCase(**stated)
        study = replace(study, cases=(asked_case(case, ASKED_FOR),))
    rows = collected(track_study(study, usable_processors()), track_line)
    figure, statements = track_figure(rows, study.cases), track_statements(rows, study.cases)
    result = report(options.out, "tracks", rows, figure, statements)
    return passing(result, all_reached(rows, study.cases), "every case reaches what is asked for")
