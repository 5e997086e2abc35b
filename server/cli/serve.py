"""``tomoshadow serve``: server and web page."""

import gc
from argparse import Namespace

from server.cli.options import Verbs, add_rig, add_verb
from server.cli.output import Outcome, progress


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, "serve", serve, "start server and web page")
    add_rig(parser)
    parser.add_argument("--host", help="address to bind to, default 127.0.0.1")
    parser.add_argument("--port", type=int, help="port to bind to, default 8080")


def serve(options: Namespace) -> Outcome:
    """Serve until interrupted; whoever else has the port, the data directory or the rig is named before all else."""
    from server.rig.config import load_config
    from server.rig.rig_lock import hold_data_dir, hold_rig
    from server.web.malloc_arenas import keep_few_arenas
    from server.web.port import listening

    keep_few_arenas()
    config = load_config(options.config)
    server = config.server.moved(options.host, options.port)
    with (
        listening(server.host, server.port) as port_held,
        listening(server.host, server.abort_port, "choose another abort_port in the rig file") as abort_port,
        hold_data_dir(server.data_dir),
    ):
        address = f"[{server.host}]" if ":" in server.host else server.host
        progress(
            f"{config.name}: opening all devices; then the page is at http://{address}:{server.port}, "
            f"and ABORT alone at port {abort_port.getsockname()[1]}; Ctrl-C ends it"
        )
        with hold_rig(config):  # is asked before the server is loaded, which takes seconds
            gc.disable()  # of 2,500 modules nothing is garbage: to look for it takes a sixth of their time
            from server.web.serve import serve_rig

            gc.freeze()
            gc.enable()
        serve_rig(config.model_copy(update={"server": server}), port_held, abort_port)
    return Outcome({})
