"""``tomoshadow runs``: the runs of a server."""

from argparse import Namespace
from dataclasses import asdict
from typing import TYPE_CHECKING

from server.cli.clients.server_option import add_server, client_of
from server.cli.options import Verbs, add_verb, count
from server.cli.output import Outcome, table

if TYPE_CHECKING:
    from tomoshadow.client import Run

_HEADS = ("run", "kind", "valid", "planned", "outcome", "cause")


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, "runs", runs, "list the runs of a server, newest first")
    parser.add_argument("--limit", type=count, default=20, metavar="N", help="at most so many, default 20")
    add_server(parser)


def runs(options: Namespace) -> Outcome:
    """List runs."""
    found = list(client_of(options).runs(options.limit))
    return Outcome({"runs": [asdict(run) for run in found]}, table(_HEADS, map(_row, found)))


def _row(run: "Run") -> tuple[str, ...]:
    counts = ("" if number is None else str(number) for number in (run.shots_valid, run.shots_planned))
    return (run.run_id, run.kind or "", *counts, run.outcome, run.cause)
