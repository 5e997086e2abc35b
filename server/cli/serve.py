"""``tomoshadow serve``: server and web page."""

from argparse import Namespace

from server.cli.options import Verbs, add_rig, add_verb
from server.cli.output import Outcome


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, "serve", serve, "start server and web page")
    add_rig(parser)
    parser.add_argument("--host", help="address to bind to, default 127.0.0.1")
    parser.add_argument("--port", type=int, help="port to bind to, default 8080")


def serve(options: Namespace) -> Outcome:
    """Serve until interrupted."""
    from server.web.serve import serve_rig

    serve_rig(options.config, options.host, options.port)
    return Outcome({})
