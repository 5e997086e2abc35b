"""WorkProgress: how far the shots of a run are that were asked for alike."""

from typing import Annotated, Any, Self

from pydantic import Field

from daq.frozen_model import FrozenModel

PROGRESS_QUERY = """
    SELECT json_extract(document, '$.results_id') AS results_id, COUNT(*), SUM(state = 'done'),
        SUM(state IN ('failed', 'aborted'))
    FROM job WHERE run_id = ? AND results_id IS NOT NULL AND state <> 'strange'
    GROUP BY results_id ORDER BY MAX(number) DESC
"""
"""Of the table of jobs, by run."""


class WorkProgress(FrozenModel):
    """Jobs of one result set, by what became of them."""

    results_id: Annotated[str, Field(description="directory of the results in the run")]
    shots: Annotated[int, Field(description="that were asked for")]
    done: Annotated[int, Field(description="of them")]
    failed: Annotated[int, Field(description="of them, or aborted")]

    @classmethod
    def of(cls, row: tuple[Any, ...]) -> Self:
        """What a row of the query says."""
        return cls(**dict(zip(cls.model_fields, row, strict=True)))

    @property
    def waiting(self) -> int:
        """Shots that are still to be done."""
        return self.shots - self.done - self.failed
