"""``tomoshadow worker``: this computer does shots for a scheduler."""

import re
from argparse import ArgumentTypeError, Namespace

from server.cli.cluster.scheduler_option import add_certificates, processing_of
from server.cli.options import Verbs, add_verb, count, positive, usable_processors
from server.cli.output import Outcome, progress

WAIT_S = 600.0


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, "worker", worker, "do shots for a scheduler, one at a time")
    parser.add_argument("--scheduler", required=True, metavar="ADDRESS", help="tls://HOST:PORT")
    add_certificates(parser)
    parser.add_argument(
        "--memory", default="auto", help="start again above it, e.g. 4GiB; default: the share of a processor"
    )
    parser.add_argument("--threads", type=count, metavar="N", help="of the kernels; default: all processors it may use")
    parser.add_argument(
        "--wait", type=positive, default=WAIT_S, metavar="S", help="for a scheduler, before giving up; default 600"
    )


def _memory(text: str) -> str:
    from server.rig.processing_config import MEMORY

    if not re.fullmatch(MEMORY, text):
        raise ArgumentTypeError(f"{text!r} is no amount of memory, for example 4GiB")
    return text


def worker(options: Namespace) -> Outcome:
    """Work until interrupted."""
    import asyncio

    from server.lab.engine.serving_cluster import WorkerOptions, serve_worker

    processing = processing_of(options)
    asked = WorkerOptions(
        scheduler=options.scheduler,
        certificates=processing.certificates,
        memory=options.memory,
        threads=options.threads or usable_processors(),
        wait_s=options.wait,
        modules=("server.lab.tasks",),
    )
    asyncio.run(serve_worker(asked, progress))
    return Outcome({})
