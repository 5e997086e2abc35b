"""The command line. ``--json`` prints one JSON object as the last line of stdout; all else goes to stderr then.

Exit status: 0 done, 1 failed (also a result that says ``passed: false``), 2 bad usage or bad input.
"""

import json
import os
import re
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from functools import cache
from typing import Any

from daq.errors import DaqError, PlanError, ShotFileError
from processing.errors import BadInput
from server.cli import (
    average,
    bench,
    demo,
    doctor,
    firmware,
    import_images,
    measure,
    optics,
    reconstruct,
    serve,
    simulate,
    study,
)
from server.cli.calibrations import calibrate, check, self_calibrate, size_calibration
from server.cli.clients import abort, run, runs, stop, watch
from server.cli.cluster import scheduler, worker
from server.cli.keeping import pack, repair, verify
from server.cli.output import endable, say, tell
from server.cli.runs import separation, tracks
from server.cli.spray import report, statistics
from server.lab.errors import ServerError
from tomoshadow.client.errors import ClientError

COMMANDS = (
    demo,
    serve,
    run,
    watch,
    abort,
    stop,
    runs,
    simulate,
    doctor,
    import_images,
    calibrate,
    check,
    self_calibrate,
    size_calibration,
    reconstruct,
    measure,
    tracks,
    separation,
    statistics,
    report,
    average,
    study,
    optics,
    bench,
    firmware,
    verify,
    repair,
    pack,
    scheduler,
    worker,
)
"""In the order of the help. Each adds its own parser; what is heavy is imported when it runs, so that help is quick."""

BLAS_THREADS = "OPENBLAS_NUM_THREADS"
"""Says how many threads numpy multiplies matrices by; it looks as it is loaded."""
_NEGATIVE = re.compile(r"-\.?\d")


def program() -> int:
    """Run the command of this process, and all that it starts, with one BLAS thread unless somebody chose otherwise.

    Matrices are small here: more threads wait for each other for longer than they work.
    """
    os.environ.setdefault(BLAS_THREADS, "1")
    return main()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; the exit status."""
    options = _parser().parse_args(_joined(sys.argv[1:] if arguments is None else arguments))
    try:
        with endable():
            outcome = options.command(options)
    except (BadInput, PlanError, ShotFileError) as error:
        return _fail(options, error, status=2)
    except ClientError as error:
        return _fail(options, error, status=2 if error.is_bad_input else 1)
    except (DaqError, ServerError, MemoryError, OSError) as error:
        return _fail(options, error, status=1)
    except KeyboardInterrupt:
        return _fail(options, RuntimeError("interrupted"), status=1)
    tell(outcome, options.json)
    return 0 if outcome.passed else 1


def _joined(arguments: Sequence[str]) -> list[str]:
    """Options joined by = with values that begin with a minus: argparse takes -5:5,-5:5,0:1 for another option."""
    joined: list[str] = []
    for argument in arguments:
        if joined and re.fullmatch(r"--[^=]+", joined[-1]) and _NEGATIVE.match(argument):
            joined[-1] += f"={argument}"
        else:
            joined.append(argument)
    return joined


def _fail(options: Namespace, error: BaseException, status: int) -> int:
    say(f"tomoshadow: {error}", sys.stderr)
    if options.json:
        code = {"code": error.code} if isinstance(error, ClientError) else {}
        say(json.dumps({"error": str(error), "kind": type(error).__name__, **code}), sys.stdout)
    return status


class _Parser(ArgumentParser):
    """Prints as commands do."""

    def _print_message(self, message: str, file: Any = None) -> None:
        say(message, file or sys.stderr, end="")


@cache
def _parser() -> ArgumentParser:
    """Of all commands; it takes a tenth of the start, and stays as it is."""
    parser = _Parser(prog="tomoshadow", description="Tomographic shadowgraphy, from trigger to volume.")
    verbs = parser.add_subparsers(required=True, metavar="COMMAND")
    for command in COMMANDS:
        command.add(verbs)
    return parser
