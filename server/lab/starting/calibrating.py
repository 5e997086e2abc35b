"""Making a calibration from a run, and using it: the one way for API and page."""

from typing import Literal

from daq.run_plan import RunKind
from server.lab.calibration_story import refusals_of_use
from server.lab.desk.visitor import Visitor
from server.lab.errors import Unprocessable
from server.lab.jobs.job import Job, calibration_job
from server.lab.services import Context
from server.lab.starting.command import command, tell_deed

CameraModel = Literal["pinhole", "pinhole_tilted", "polynomial", "auto"]


def request_calibration(context: Context, run_id: str, model: CameraModel, who: Visitor) -> Job:
    """Queue the fit; it takes nobody's control, because nothing uses its result before somebody chooses it.

    Raises
    ------
    NotFound
        There is no such run.
    Unprocessable
        The run shows no target.
    """
    summary = context.runs.summary(run_id)
    context.runs.require_sound(summary)
    if summary.kind not in (RunKind.CALIBRATION, None):
        raise Unprocessable(f"run {run_id} is a {summary.kind} run, a calibration run is needed")
    job = context.runner.submit(calibration_job(run_id, f"{run_id}-{model}", model))
    tell_deed(context, who, f"asked for calibration {job.calibration}")
    return job


def use_calibration(context: Context, who: Visitor, calibration_id: str) -> None:
    """Make a calibration the current one, and tell every page.

    Raises
    ------
    NotFound, Damaged
        There is none, or nobody can read it.
    Unprocessable
        A view of it is refused.
    Forbidden, Locked
        See ``command``.
    """

    def choose() -> None:
        if reasons := refusals_of_use(context, calibration_id):
            raise Unprocessable("; ".join(reasons), "calibration_refused")
        context.calibrations.choose(calibration_id)
        context.services.events.publish("calibration_chosen", calibration=calibration_id)

    command(context, who, f"chose calibration {calibration_id}", choose)
