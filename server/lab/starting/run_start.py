"""Starting a run, or a single shot: the one way for API and page."""

from typing import Annotated

from pydantic import Field

from daq.frozen_model import FrozenModel
from daq.names import Identifier
from daq.run.refusals import raise_first
from daq.run_plan import PulsePair, RunPlan
from server.lab.services import Context
from server.lab.starting.readiness import refusals_of_lab, with_defaults


def start_run(context: Context, plan: RunPlan) -> str:
    """Start a run that nothing speaks against; the run id. Blocks until the run is accepted or refused.

    Raises
    ------
    DaqError, ServerError
        The first of ``reasons_against`` this plan, see ``server.lab.starting.readiness``.
    """
    plan = with_defaults(context, plan)
    raise_first(refusals_of_lab(context, plan))
    return context.services.acquisition.start(plan)


class SingleShot(FrozenModel):
    """One shot that is kept on request only."""

    pulse: Annotated[PulsePair, Field(description="its light")]
    references: Annotated[
        tuple[str, ...], Field(description="run ids of the dark and background runs that belong to it")
    ] = ()
    calibration: Annotated[Identifier | None, Field(description="for its volumes; null: the current one")] = None


def shoot(context: Context, shot: SingleShot) -> str:
    """Start a run of one shot, which the next one removes; the run id. Raises what ``start_run`` raises."""
    plan = RunPlan(
        name="single-shot",
        shots=1,
        pulse=shot.pulse,
        references=shot.references,
        calibration=shot.calibration,
        recipes=(),
    )
    return context.unkept_runs.add(lambda: start_run(context, plan))
