"""Which shots of a run a command works on, and whether the run is whole."""

import re
from pathlib import Path

from processing.runs.errors import PipelineError
from server.cli.output import progress


def selected_shots(run_dir: Path, selection: str | None) -> list[int]:
    """Valid sample shots within A:B; one that was flagged while recording is left out, one that is torn is an error."""
    from daq.files.run_directory import ImageKey, RunReader

    first, last = _bounds(selection)
    with RunReader(run_dir) as run:
        if told := ended(run.outcome, run.cause):
            progress(f"{run_dir.name}: {told}")
        keys = dict(enumerate(run.image_keys().tolist()[:last]))
        wanted = {index: key for index, key in keys.items() if index >= first}
        for index in (index for index, key in wanted.items() if key == ImageKey.INVALID):
            run.read_shot(index)
            progress(f"{run_dir.name}: shot {index} is invalid, left out")
    chosen = [index for index, key in wanted.items() if key == ImageKey.SAMPLE]
    if not chosen:
        raise PipelineError(f"{run_dir}: has no valid sample shots" + (f" in {selection}" if selection else ""))
    return chosen


def ended(outcome: str | None, cause: str) -> str:
    """How a run ended that was not completed; empty for one that was."""
    if outcome is None:
        return "has no outcome: it was interrupted, or is still being recorded; there may be more shots to come"
    return "" if outcome == "completed" else f"was {outcome}, it is not complete" + (f": {cause}" if cause else "")


def _bounds(selection: str | None) -> tuple[int, int | None]:
    match = re.fullmatch(r"(\d*):(\d*)", selection or ":")
    if not match:
        raise PipelineError(f"--shots {selection!r} is not of the form A:B")
    first, last = match.groups()
    return int(first or 0), int(last) if last else None
