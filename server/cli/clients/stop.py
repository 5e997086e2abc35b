"""``tomoshadow stop``: end the run under way after its present shot."""

from argparse import Namespace

from server.cli.clients.server_option import add_server, client_of
from server.cli.options import Verbs, add_verb
from server.cli.output import Outcome


def add(verbs: Verbs) -> None:
    """Add the command."""
    add_server(add_verb(verbs, "stop", stop, "end the run under way after its present shot; abort ends it at once"))


def stop(options: Namespace) -> Outcome:
    """Stop what runs; nothing to do where nothing does."""
    client = client_of(options)
    run_id = client.rig().acquisition.active_run
    if run_id is None:
        return Outcome({"run_id": None}, "no run is under way")
    client.stop(run_id)
    return Outcome({"run_id": run_id}, f"run {run_id} ends after its present shot")
