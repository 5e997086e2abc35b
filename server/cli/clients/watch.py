"""``tomoshadow watch``: see a run under way to its end."""

from argparse import Namespace

from server.cli.clients.server_option import add_server, client_of
from server.cli.clients.watching import watched
from server.cli.options import Verbs, add_verb
from server.cli.output import Outcome


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, "watch", watch, "watch a run of a server to its end")
    parser.add_argument("run", nargs="?", metavar="RUN", help="id of a run; default: the one under way")
    add_server(parser)


def watch(options: Namespace) -> Outcome:
    """Watch a run; where none is under way, say what the rig does."""
    client = client_of(options)
    run_id = options.run or client.rig().acquisition.active_run
    if run_id:
        return watched(client, run_id, options)
    rig = client.readiness()
    return Outcome({"run_id": None, "state": rig.state}, f"no run is under way; the rig is {rig.text}")
