"""``tomoshadow scheduler``: deals the shots of commands and servers to workers."""

from argparse import ArgumentTypeError, Namespace

from server.cli.cluster.scheduler_option import add_certificates
from server.cli.options import Verbs, add_verb, count
from server.cli.output import Outcome, progress

PORT = 8786
_LAST = 65535


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(
        verbs, "scheduler", scheduler, "deal shots to workers; on this computer alone without certificates"
    )
    parser.add_argument("--port", type=_port, default=PORT, help=f"to listen at, default {PORT}")
    add_certificates(parser)


def _port(text: str) -> int:
    """Refuse what the operating system would take for another port."""
    if (port := count(text)) > _LAST:
        raise ArgumentTypeError(f"{text} must be {_LAST} or less")
    return port


def scheduler(options: Namespace) -> Outcome:
    """Serve until interrupted."""
    import asyncio

    from processing.runs.errors import PipelineError
    from server.lab.engine.serving_cluster import serve_scheduler
    from server.rig.certificates import require_certificates

    if options.certificates:
        try:
            require_certificates(options.certificates)
        except ValueError as error:
            raise PipelineError(f"--certificates {options.certificates}: {error}") from error
    asyncio.run(serve_scheduler(options.port, options.certificates, progress))
    return Outcome({})
