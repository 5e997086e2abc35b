"""``tomoshadow run``: start a run by the server, and watch it."""

from argparse import Namespace
from contextlib import suppress
from pathlib import Path

from server.cli.clients.server_option import add_server, client_of, named
from server.cli.clients.watching import watched
from server.cli.options import Verbs, add_verb
from server.cli.output import Outcome


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, "run", run, "start a run by a server that is running, and watch it to its end")
    parser.add_argument(
        "plan", type=Path, metavar="PLAN.toml", help="name, kind, shots, rate_hz, [pulse], as in the API"
    )
    parser.add_argument(
        "--take-control", action="store_true", help="from whoever holds it; without, a start is refused then"
    )
    add_server(parser)


def run(options: Namespace) -> Outcome:
    """Check the plan, start it once, and watch it; passed: the run was completed."""
    from server.cli.clients.plan_file import read_plan
    from tomoshadow.client import ClientError

    plan, client = read_plan(options.plan), client_of(options)
    try:
        if options.take_control:
            client.take_control()
        run_id = client.start(plan)
    except KeyboardInterrupt:
        ask = f"tomoshadow watch{named(options)}"
        text = f"interrupted while the start was asked for: {ask} tells whether the run is under way"
        return Outcome({"passed": False, "run_id": None}, text)
    outcome = watched(client, run_id, options)
    if outcome.result["outcome"] != "active":
        with suppress(ClientError):
            client.give_control_back()
    return outcome
