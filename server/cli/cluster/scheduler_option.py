"""``--scheduler``: a command gives its shots to the workers of other computers."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Generator, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from daq.errors import DaqError
from processing.errors import BadInput
from processing.runs.errors import PipelineError

if TYPE_CHECKING:
    from server.lab.engine.task import Task
    from server.rig.processing_config import ProcessingConfig


_OPTION_OF = {"paths": "path"}


def add_scheduler(parser: ArgumentParser) -> None:
    """Let a command be told whose workers do its shots."""
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="tls://HOST:PORT; its workers do the shots, docs/cluster.md"
    )
    add_certificates(parser)
    parser.add_argument(
        "--path",
        action="append",
        type=_renamed,
        default=[],
        metavar="HERE=THERE",
        help="what workers call a folder of this computer; may be repeated",
    )


def add_certificates(parser: ArgumentParser) -> None:
    """Let a command be told by what it is known to others."""
    parser.add_argument("--certificates", type=Path, metavar="DIR", help="folder of ca.pem, cert.pem and key.pem")


def _renamed(text: str) -> tuple[str, str]:
    here, equals, there = text.partition("=")
    if not equals:
        raise ArgumentTypeError(f"{text!r} is not of the form HERE=THERE")
    return str(Path(here).absolute()), there


def processing_of(options: Namespace) -> "ProcessingConfig":
    """What the options say of a scheduler, as in a rig file.

    Raises
    ------
    PipelineError
        They cannot be followed.
    """
    from pydantic import ValidationError

    from server.rig.processing_config import ProcessingConfig

    said = {
        "scheduler": options.scheduler,
        "certificates": options.certificates,
        "paths": dict(getattr(options, "path", ())),
    }
    try:
        return ProcessingConfig.model_validate(said)
    except ValidationError as error:
        (problem, *_) = error.errors()
        told = problem["msg"].removeprefix("Value error, ")
        if problem["loc"]:
            key = str(problem["loc"][0])
            told = f"{_OPTION_OF.get(key, key)} {problem['input']}: {told}"
        raise PipelineError(f"--{told}") from error


def require_followed(options: Namespace) -> None:
    """Refuse options of a scheduler that cannot be followed, before anything is done.

    Raises
    ------
    PipelineError
        The text says which, and why.
    """
    if options.scheduler:
        processing_of(options)
    elif options.certificates or options.path:
        raise PipelineError(f"{'--certificates' if options.certificates else '--path'}: is for --scheduler")


def shots_elsewhere(
    options: Namespace, task: "Task", run_dir: Path, indices: Sequence[int], out: Path, job: dict[str, Any]
) -> Generator[dict[str, Any], None, None]:
    """Let the workers of a scheduler do shots; what they tell, in the order of the shots.

    Raises
    ------
    TaskError
        A shot has failed, or there is nobody to do it.
    """
    from server.lab.engine.cluster_engine import ClusterEngine
    from server.lab.engine.in_order import results_in_order
    from server.lab.engine.task import TaskError

    common = {
        "run_dir": str(run_dir),
        "calibration_file": str(options.calibration),
        "results_dir": str(out),
        **job,
    }
    jobs = {f"{run_dir.name}, shot {index}": {**common, "shot": index} for index in indices}
    with closing(results_in_order(ClusterEngine(processing_of(options)), task, jobs)) as results:
        try:
            yield from results
        except TaskError as error:
            if isinstance(error.__cause__, BadInput | DaqError):
                raise error.__cause__ from error  # what is wrong with a shot is the same wherever it is done
            raise
