"""``tomoshadow report``: a page about a spray that prints well, from droplets that are measured."""

from argparse import Namespace
from pathlib import Path

from daq.counted import counted
from server.cli.options import Verbs, add_out, add_verb
from server.cli.output import Outcome
from server.cli.spray.spray_options import add_sprays, asked_for


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, "report", report, "a page of figures and tables about a spray, from measured droplets")
    add_sprays(parser)
    add_out(parser, "the page; default report.html", default=Path("report.html"))


def report(options: Namespace) -> Outcome:
    """Pool the shots of all results, and write the page."""
    from processing.runs.overwriting import replacing, require_free
    from processing.runs.sprays.measured_spray import read_spray
    from server.reports.spray_report import ReportedSpray, write_spray_report

    require_free(options.out, overwrite=options.overwrite)
    spray = read_spray(options.results)
    reported = ReportedSpray.of(spray, asked_for(options, spray))
    with replacing(options.out) as part:
        write_spray_report(part, reported)
    result = {"report": str(options.out), "results": spray.name, "shots": len(spray.shots)}
    return Outcome(result, f"{options.out}: {counted(reported.told.droplets.n, 'droplet')}, shots: {len(spray.shots)}")
