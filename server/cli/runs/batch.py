"""Many runs by one recipe: each has results of its own, and one that fails does not stop the others."""

from argparse import ArgumentParser, Namespace
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from daq.errors import DaqError
from processing.errors import BadInput
from processing.runs.errors import PipelineError
from server.cli.options import run_directory
from server.cli.output import Outcome, progress
from server.lab.errors import ServerError

Work = Callable[[Path, Path], Outcome]
"""Run, directory of its results -> what was found."""


def add_runs(parser: ArgumentParser) -> None:
    """Let a command be told runs."""
    summary = "run directory, or that of an import which has a run; of several, each gets a folder of its name in OUT"
    parser.add_argument("runs", nargs="+", type=run_directory, metavar="RUN", help=summary)


def over_runs(options: Namespace, work: Work) -> Outcome:
    """Work on one run into the directory that was named, or on several into folders in it.

    Raises
    ------
    PipelineError
        Two runs are called the same.
    """
    if len(options.runs) == 1:
        return work(options.runs[0], options.out)
    named = [(_name(run_dir), run_dir) for run_dir in options.runs]
    if twice := [name for name, count in Counter(name for name, _ in named).items() if count > 1]:
        raise PipelineError(f"two runs are called {twice[0]}: their results would share a folder; take one by one")
    outcomes = [(name, _attempt(work, name, run_dir, options.out / name)) for name, run_dir in named]
    told = [{"run": name, "out": str(options.out / name), **outcome.result} for name, outcome in outcomes]
    result: dict[str, Any] = {"runs": told, "passed": all(outcome.passed for _, outcome in outcomes)}
    return Outcome(result, "\n".join(f"{name}\n{outcome.text}" for name, outcome in outcomes))


def _name(run_dir: Path) -> str:
    """Of a run; that of an import lies in a folder ``run``."""
    where = run_dir.resolve()
    return where.parent.name if where.name == "run" else where.name


def _attempt(work: Work, name: str, run_dir: Path, out: Path) -> Outcome:
    try:
        return work(run_dir, out)
    except (BadInput, DaqError, ServerError, OSError) as error:
        progress(f"{name}: {error}")
        return Outcome({"error": str(error), "kind": type(error).__name__, "passed": False}, f"failed: {error}")
