"""``tomoshadow study breakup``: break-up lengths and classes of liquid that is no droplet, where the truth is known."""

from argparse import Namespace
from typing import Any

from server.cli.options import Verbs, count, seed, usable_processors
from server.cli.studies.study_command import add_study, collected, passing, report


def add_break_up(studies: Verbs) -> None:
    """Add the study."""
    parser = add_study(studies, "breakup", break_up, "break-up lengths, and classes of liquid that is no droplet")
    parser.add_argument("--runs", type=count, default=5, help="of each nozzle")
    parser.add_argument("--shots", type=count, default=4, help="of each run")
    parser.add_argument("--binning", type=int, choices=(1, 2), default=1, help="of pixels; 1 is the paper's")
    parser.add_argument("--seed", type=seed, default=901, help="of the first run")


def break_up(options: Namespace) -> dict[str, Any]:
    """Run the study."""
    from processing.studies.liquid.break_up import (
        BreakUpStudy,
        break_up_figure,
        break_up_line,
        break_up_reached,
        break_up_statements,
        break_up_study,
    )
    from processing.studies.liquid.isolated_objects import isolated_objects
    from processing.studies.report import csv_text

    study = BreakUpStudy(options.runs, options.shots, options.binning, options.seed)
    threads = usable_processors()
    runs = collected(break_up_study(study, threads), break_up_line)
    objects = list(isolated_objects(tuple(range(study.seed, study.seed + study.runs)), threads))
    rows = [run.row for run in runs]
    result = report(options.out, "breakup", rows, break_up_figure(runs), break_up_statements(rows, objects))
    classes = options.out / "breakup-classes.csv"
    classes.write_text(csv_text(objects), encoding="utf-8")
    result = {**result, "classes": str(classes)}
    passed = break_up_reached(rows, objects)
    return passing(result, passed, "lengths, intervals and classes reach what is asked for")
