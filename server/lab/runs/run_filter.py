"""RunFilter: which runs of a long list somebody wants to see. Pure."""

from enum import StrEnum
from typing import Annotated

from pydantic import Field

from daq.frozen_model import FrozenModel
from daq.run_plan import RunKind
from server.lab.runs.run_summary import RunSummary

MOST_TEXT = 200


class ListedOutcome(StrEnum):
    """What stands in a list as the outcome of a run."""

    COMPLETED = "completed"
    STOPPED = "stopped"
    ABORTED = "aborted"
    FAILED = "failed"
    INTERRUPTED = "interrupted"
    ACTIVE = "active"
    DAMAGED = "damaged"
    PACKED = "packed"


class RunFilter(FrozenModel):
    """What a run must be; what is not said is not asked."""

    kind: Annotated[RunKind | None, Field(description="what was prepared")] = None
    outcome: Annotated[ListedOutcome | None, Field(description="how it ended")] = None
    text: Annotated[
        str, Field(max_length=MOST_TEXT, description="words, all of which its id, name, cause, notes, ... hold")
    ] = ""
    results: Annotated[bool | None, Field(description="with results, or without any")] = None

    @property
    def takes_all(self) -> bool:
        """Whether nothing is asked."""
        return self.kind is None and self.outcome is None and self.results is None and not self.text.split()

    def accepts(self, run: RunSummary) -> bool:
        """Whether a run is wanted, as far as its summary tells; nobody knows there whether it has results."""
        return self.kind in (None, run.kind) and self.outcome in (None, run.outcome) and _holds(run, self.text.split())


EVERY_RUN = RunFilter()


def _holds(run: RunSummary, words: list[str]) -> bool:
    if not words:
        return True
    text = _text_of(run).casefold()
    return all(word.casefold() in text for word in words)


def _text_of(run: RunSummary) -> str:
    notes = run.notes
    conditions = (notes.operator, notes.fluid, notes.nozzle, notes.remark, *map(str, notes.more.values()))
    return "\n".join((run.run_id, run.name, run.cause, run.calibration or "", *run.references, *conditions))
