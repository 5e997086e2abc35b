"""``tomoshadow abort``: light off, whatever runs."""

from argparse import Namespace

from server.cli.clients.server_option import add_server, client_of
from server.cli.options import Verbs, add_verb, count
from server.cli.output import Outcome


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(
        verbs, "abort", abort, "light off at once, whatever runs; says within a second if that is confirmed"
    )
    parser.add_argument(
        "--abort-port", type=count, metavar="N", help="of ABORT alone, as serve says; default: asked for"
    )
    add_server(parser)


def abort(options: Namespace) -> Outcome:
    """Light off by every way that there is; ClientError where nobody confirms it in time."""
    ended = client_of(options).abort(port=options.abort_port)
    return Outcome({"light": "off", "ended": ended}, f"light off confirmed; ended: {ended}")
